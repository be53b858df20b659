"""The live view: a process that listens to a running bench and serves a page on this machine."""
