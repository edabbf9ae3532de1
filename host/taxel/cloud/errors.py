"""Errors of clouds and meshes; each one prints as one line."""

from taxel.errors import FieldError


class CloudError(FieldError):
    """A cloud that cannot be used for the requested operation.

    file: name of the cloud. field: the unsuitable part of the cloud, for example ``points``.
    """


class MeshError(CloudError):
    """A mesh that cannot be used: not finite, not closed, or not made of triangles."""


class RegistrationError(CloudError):
    """An alignment that has no unique solution, or that did not converge."""


class CloudFileError(CloudError):
    """A file of points or triangles that cannot be read or written."""
