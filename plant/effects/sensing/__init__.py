"""Effects of sensors and clocks: takes measured arrays, gives one `Effect` a file, each a pure function of arrays."""
