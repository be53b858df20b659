"""Effects of the tyres: takes the vectors of the model, gives one `Effect` a file."""
