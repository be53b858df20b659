"""Effects of pads, discs and calipers: takes the vectors of the model, gives one `Effect` a file."""
