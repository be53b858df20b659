"""Effects of the motors and the battery: takes the vectors of the model, gives one `Effect` a file."""
