"""Newton's method, continuation, time integration: general methods that know nothing of cells."""
