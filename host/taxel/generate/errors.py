"""What can be wrong with a recipe, a folder of shards, or those who make them."""

from taxel.errors import FieldError, TaxelError


class RecipeError(FieldError, ValueError):
    """A recipe that cannot be used; field: the key in it."""


class FolderError(FieldError, ValueError):
    """A folder in which a recipe cannot be made or continued; field: what in it."""


class ClusterError(TaxelError):
    """A cluster that cannot be used. Attributes: where, found, remedy."""

    def __init__(self, where: str, found: str, remedy: str) -> None:
        super().__init__(where, found, remedy)
        self.where, self.found, self.remedy = where, found, remedy

    def __str__(self) -> str:
        return f"{self.where}: {self.found}; {self.remedy}"


class HopelessDrawError(TaxelError):
    """A grasp whose every draw failed. Attributes: number, label, reason."""

    def __init__(self, number: int, label: str, reason: str) -> None:
        super().__init__(number, label, reason)
        self.number, self.label, self.reason = number, label, reason

    def __str__(self) -> str:
        return f"grasp {self.number}, {self.label}: no draw could be simulated ({self.reason}); narrow its ranges"
