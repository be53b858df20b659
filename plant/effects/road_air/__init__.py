"""Effects of the road and the air: takes the vectors of the model, gives one `Effect` a file."""
