"""What bad input gets, on the command line and in the API: exit code 2, one sentence, nothing half-written."""
