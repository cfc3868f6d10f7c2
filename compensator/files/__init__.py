"""Reading and writing of files, and progress."""
