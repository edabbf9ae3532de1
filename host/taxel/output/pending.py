"""An output under a temporary name, which gets its final name in one step when it is complete.

Order of the steps, and the reason of each:

1. The temporary file `.NAME.part` is created in the folder of the target, because a rename works only within one file
   system, and is locked, so that a second program cannot write the same output. The temporary file of a killed program
   has no lock; the next writer of the same output replaces it.
2. An existing target gets a shared lock, so that no other program extends it while its replacement is written.
3. The content is flushed to the disk before the rename. A file system may otherwise write the new name first, and a
   power failure leaves an empty file under it.
4. The temporary file is renamed. Before this step the old file is complete, afterwards the new one.
5. The folder is flushed, so that the new name survives a power failure.
"""

import errno
import os
import shutil
import stat
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from taxel.output.disk import flush_file, flush_folder, flush_tree
from taxel.output.errors import fail, fail_existing
from taxel.output.exchange import exchange
from taxel.output.locks import fail_locked, try_lock

_LONGEST_NAME: Final = 255
"""Longest file name of Linux, bytes (limits.h, NAME_MAX)."""

_NO_LINKS: Final = frozenset({errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EXDEV})
"""Errors of a file system without hard links (manual page of link)."""


def get_part_path(target: Path) -> Path:
    """Return the temporary path of an output, shortened to the longest permitted name.

    A file that remains under this name after SIGKILL can be deleted.
    """
    start, end = ".", ".part"
    name = os.fsencode(target.name)[: _LONGEST_NAME - len(start) - len(end)]
    return target.with_name(f"{start}{os.fsdecode(name)}{end}")


class PendingOutput:
    """A file or folder that is written at `part`, until `commit` gives it its final name or `discard` removes it.

    A context manager: the end of the block commits, an exception discards. Missing parent folders are created, and
    removed again by `discard`. A target that is a symbolic link is replaced at the link's destination.

    Attributes:
        part: path to write to. The file exists and is empty; the folder exists and is empty.
        descriptor: open file descriptor of `part`, for reading and writing; of a folder for reading.
    """

    def __init__(
        self, path: str | os.PathLike[str], *, overwrite: bool, is_folder: bool = False, mode: int = 0o666
    ) -> None:
        """Create and lock the temporary file or folder of the output `path`.

        overwrite: replace an existing target. mode: permissions of a new file, before the mask of the process.
        Raises OutputError if the target exists and `overwrite` is False, is of another type, or is being written by
        another program; OSError if the system refuses.
        """
        self.path = Path(path)
        self._overwrite, self._is_folder, self._mode = overwrite, is_folder, mode
        self._check_target()
        self.target = Path(os.path.realpath(path))
        self.part = get_part_path(self.target)
        self.descriptor = self._target_lock = -1
        self._has_part = False
        self._new_folders: list[Path] = []
        try:
            self._create_folders()
            self._open_part()
            self._lock_target()
        except OSError as error:
            self.discard()
            raise OSError(error.errno, error.strerror, os.fspath(path)) from error
        except BaseException:
            self.discard()
            raise

    def _check_target(self) -> None:
        """Raise OutputError for an existing target that must not be replaced or has another type than the output."""
        try:
            status = os.stat(self.path)
        except FileNotFoundError:
            return
        if self._is_folder != stat.S_ISDIR(status.st_mode):
            kinds = ("the name of a folder", "a file") if self._is_folder else ("the name of a file", "a folder")
            fail(self.path, *kinds, "choose another name")
        if not self._is_folder and not stat.S_ISREG(status.st_mode):
            fail(self.path, "a regular file", "a device or pipe", "choose another name")
        if not self._overwrite:
            fail_existing(self.path)

    def _create_folders(self) -> None:
        """Create the missing parent folders of the target, and store them for `discard`."""
        missing = []
        folder = self.target.parent
        while not folder.exists():
            missing.append(folder)
            folder = folder.parent
        for folder in reversed(missing):
            with suppress(FileExistsError):
                folder.mkdir()
                self._new_folders.append(folder)

    def _open_part(self) -> None:
        """Create, lock and empty the temporary file or folder.

        Between opening and locking, another program may have renamed or removed the temporary file. The lock would then
        protect another file; therefore opening and locking are repeated.
        """
        while True:
            self.descriptor = self._create_part()
            if not try_lock(self.descriptor):
                fail_locked(self.path, self.descriptor)
            opened = os.fstat(self.descriptor)
            with suppress(FileNotFoundError):
                if os.path.samestat(opened, os.stat(self.part, follow_symlinks=False)):
                    break
            self._close_descriptors()
        self._has_part = True
        if self._is_folder:
            for name in os.listdir(self.part):
                _remove(self.part / name)
        else:
            os.ftruncate(self.descriptor, 0)
        # A library of the same process may read the file before it is complete, for which HDF5 needs a shared lock.
        # A second writer requests an exclusive lock, and is refused.
        if not try_lock(self.descriptor, is_shared=True):
            fail_locked(self.path, self.descriptor)

    def _create_part(self) -> int:
        """Open the temporary file or folder, and create it if it is missing; return its descriptor.

        A folder in place of the file, a file in place of the folder, and a symbolic link are removed first.
        """
        while True:
            try:
                if not self._is_folder:
                    return os.open(self.part, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, self._mode)
                with suppress(FileExistsError):
                    self.part.mkdir()
                return os.open(self.part, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
            except OSError as error:
                if error.errno not in (errno.EISDIR, errno.ENOTDIR, errno.ELOOP):
                    raise
                _remove(self.part)

    def _lock_target(self) -> None:
        """Lock an existing target until it is replaced. Raises OutputError if another program writes it.

        A target that cannot be read is not locked.
        """
        try:
            self._target_lock = os.open(self.target, os.O_RDONLY | os.O_CLOEXEC)
        except (FileNotFoundError, PermissionError):
            return
        if not try_lock(self._target_lock, is_shared=True):
            fail_locked(self.path, self._target_lock)

    def commit(self, content: Path | None = None) -> None:
        """Flush the output to the disk and give it its final name. A second call has no effect.

        content: another file in the folder of the target or below, which becomes the output instead of `part`, for a
        program that must create its file itself.
        Raises OutputError if the target was created meanwhile and `overwrite` is False, OSError if the system refuses;
        the target is then unchanged and the temporary file is removed.
        """
        if not self._has_part:
            return
        try:
            if self._is_folder:
                flush_tree(self.part)
            else:
                flush_file(content or self.part)
                self._copy_permissions(content or self.part)
            self.rename(content)
            flush_folder(self.target.parent)
        except OSError as error:
            raise OSError(error.errno, error.strerror, os.fspath(self.path)) from error
        finally:
            self.discard()

    def _copy_permissions(self, content: Path) -> None:
        """Give the new file the permissions and the owner of the file that it will replace."""
        if self._target_lock < 0:
            return
        old = os.fstat(self._target_lock)
        with suppress(OSError):
            os.chmod(content, stat.S_IMODE(old.st_mode))
            os.chown(content, old.st_uid, old.st_gid)

    def rename(self, content: Path | None = None) -> None:
        """Give the temporary file or folder its final name, without a flush. Raises OutputError or OSError."""
        if self._is_folder:
            # The replaced folder is still locked under the temporary name until `discard` has removed it.
            self._has_part = self._rename_folder()
        else:
            self._rename_file(content or self.part)
            self._has_part = content is not None
        self._new_folders.clear()

    def _rename_folder(self) -> bool:
        """Give the temporary folder its final name; return whether the replaced folder now has the temporary name."""
        if self._overwrite:
            return exchange(self.part, self.target)
        try:
            os.rename(self.part, self.target)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
                raise
            fail_existing(self.path)
        return False

    def _rename_file(self, content: Path) -> None:
        """Give the new file its final name. Raises OutputError if the target must not be replaced, OSError."""
        if not self._overwrite:
            try:
                os.link(content, self.target)  # unlike a rename, fails if the name exists
            except FileExistsError:
                fail_existing(self.path)
            except OSError as error:
                if error.errno not in _NO_LINKS:
                    raise
            else:
                content.unlink()
                return
        os.replace(content, self.target)

    def discard(self) -> None:
        """Remove the temporary file or folder and the folders created for it. A second call has no effect.

        After a rename the temporary name is free, and may belong to the next writer; only the locks are released then.
        """
        if self._has_part:
            _remove(self.part)
        self._abandon()

    def _abandon(self) -> None:
        """Release the locks, and remove created folders that are empty."""
        self._close_descriptors()
        for folder in reversed(self._new_folders):
            with suppress(OSError):
                folder.rmdir()
        self._new_folders = []
        self._has_part = False

    def _close_descriptors(self) -> None:
        """Close the open files, which releases their locks."""
        for descriptor in (self.descriptor, self._target_lock):
            if descriptor >= 0:
                with suppress(OSError):
                    os.close(descriptor)
        self.descriptor = self._target_lock = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Commit the output at the end of the `with` block, or discard it after an exception."""
        if kind is None:
            self.commit()
        else:
            self.discard()


def _remove(path: Path) -> None:
    """Remove a file, a link or a folder with its content, as far as the system permits."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()
