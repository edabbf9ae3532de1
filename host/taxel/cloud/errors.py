"""What can go wrong with a cloud or a mesh; each mistake prints as one line."""

from taxel.errors import FieldError


class CloudError(FieldError):
    """A cloud that cannot be used as asked. file: the cloud's name; field: the part of it, such as ``points``."""


class MeshError(CloudError):
    """A mesh that cannot be used: not finite, not closed, not of triangles."""


class RegistrationError(CloudError):
    """An alignment that has no solution, or found none."""


class CloudFileError(CloudError):
    """A file of points or triangles that cannot be read or written."""
