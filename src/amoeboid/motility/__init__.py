"""Where a cell goes: its velocity in an environment, from its shape and its flow."""
