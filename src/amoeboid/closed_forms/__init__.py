"""Closed forms of the paper and their general form: dimensional, for any law, broadcasting."""
