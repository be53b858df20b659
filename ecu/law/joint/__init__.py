"""Takes sensor values and gives speed, wheel torques and pad frictions: one extended Kalman filter over all of them.

What the paper does in two stages (wheel torque, then pad friction) is one estimation problem: the wheel torque is
T = T_motor - mu G (p - p0), and the accelerations of car and wheels tell what sum and which shares of T were true.
States: speed v, offset b of the acceleration sensor, grade theta, mass factor c, tyre stiffness factor s with the
difference d between the axles, four rolling-radius factors, four pad frictions mu. The body acceleration is an input;
the measurements are the force balance and the four wheel speeds (their slip), each used once.

Decisions that make it work: the pad friction only moves while pressure is applied; the mass factor is only learned
while no friction brake is (else it would take part of the friction's error); wheels that slide are left out;
torques are delayed as the sensors delay the accelerations.
"""
