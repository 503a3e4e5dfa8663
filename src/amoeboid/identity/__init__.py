"""What a result depends on, as a text: functions with their code, parameters, other arguments."""
