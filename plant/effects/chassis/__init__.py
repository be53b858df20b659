"""Effects of masses, springs, hubs and steering: takes the vectors of the model, gives one `Effect` a file."""
