"""Exit codes of the command line."""

FAILURE, USER_MISTAKE, INTERRUPTED = 1, 2, 130
