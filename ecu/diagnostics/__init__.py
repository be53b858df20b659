"""Diagnostics of the controller by UDS (ISO 14229-1), beside the control law: frames in, frames and orders out."""
