"""What other people's libraries read for us, each in a process of its own with limits: Parquet, ARXML, KCD, SYM."""
