"""What is said in the end: verdict, rivals, what to drive, the extension, its gain, and the report."""
