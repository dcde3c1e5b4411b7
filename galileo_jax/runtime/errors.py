"""Errors a user can mend: wrong input or a wrong call."""


class InputError(ValueError):
    """A wrong input or call, in one line; commands print it and exit with 2.

    The message names the file, the key, the value found and what would be right:
    ``clip.yaml: ramp_angle_deg: 95 is outside (0, 90) degrees``.
    """
