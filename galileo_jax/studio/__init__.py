"""One local page: film, mark, track, fit, see where it fails, add what is missing, predict."""
