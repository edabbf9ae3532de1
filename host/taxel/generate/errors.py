"""Errors of recipes, folders of shards, and workers."""

from taxel.errors import FieldError, TaxelError


class RecipeError(FieldError, ValueError):
    """A recipe with an error. field: the key in the recipe."""


class FolderError(FieldError, ValueError):
    """A folder in which a recipe cannot be generated or continued. field: the part of the folder."""


class ClusterError(TaxelError):
    """A cluster that cannot be used. Attributes: where, found, remedy."""

    def __init__(self, where: str, found: str, remedy: str) -> None:
        """Create the error of a cluster. where: scheduler. found: what happened. remedy: what to do."""
        super().__init__(where, found, remedy)
        self.where, self.found, self.remedy = where, found, remedy

    def _format_message(self) -> str:
        """Format the error as one line with scheduler, cause and remedy."""
        return f"{self.where}: {self.found}; {self.remedy}"


class SamplingError(TaxelError):
    """A generated grasp for which no sample could be simulated. Attributes: number, label, reason."""

    def __init__(self, number: int, label: str, reason: str) -> None:
        """Create the error. number: number of the grasp. label: kind of object. reason: why the last sample failed."""
        super().__init__(number, label, reason)
        self.number, self.label, self.reason = number, label, reason

    def _format_message(self) -> str:
        """Format the error as one line with the number of the grasp, the reason and the remedy."""
        return f"grasp {self.number}, {self.label}: no sample could be simulated ({self.reason}); narrow its ranges"
