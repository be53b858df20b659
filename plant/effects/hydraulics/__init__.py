"""Effects of pressure control, lines and fluid: takes the vectors of the model, gives one `Effect` a file."""
