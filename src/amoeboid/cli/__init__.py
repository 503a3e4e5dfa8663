"""The command line: parses, calls, prints; no physics. One module a command."""
