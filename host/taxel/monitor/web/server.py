"""Start of viser's server such that viser receives only requests and messages that the monitor has checked."""

from __future__ import annotations

import contextlib
import io
import logging
import socket
import threading
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from taxel.errors import TaxelError
from taxel.monitor.web.gate import Gate, Refusal
from taxel.monitor.web.refusals import Refusals
from taxel.optional import optional_import

if TYPE_CHECKING:
    import viser

HOST: Final = "127.0.0.1"

_START_LOCK: Final = threading.Lock()


class WebError(TaxelError):
    """Error: the browser page of the monitor cannot be served."""


def open_socket(port: int) -> socket.socket:
    """Open a listening socket on 127.0.0.1. port: 0 for a free port. Raises `WebError` if the port is not available."""
    try:
        return socket.create_server((HOST, port))
    except OSError as error:
        raise WebError(
            f"port {port} of {HOST} is not available ({error.strerror or error}); choose another --port"
        ) from None


def start_server(
    port: int, gate: Gate, refusals: Refusals, check_message: Callable[[bytes | str], Refusal | None]
) -> viser.ViserServer:
    """Start viser's server with the page of the monitor behind the checks of `gate`.

    port: 0 for a free port. check_message: returns why a message of a page is ignored, None for a valid message.
    Raises `WebError` if the port is not available, or if the checks cannot be installed in this version of viser;
    `MissingPackageError` if viser is not installed.
    """
    with optional_import("viser", "--web"):
        import viser
        from viser.infra import _infra
    from taxel.monitor.web.admission import Admission

    # Refused requests and connections that a browser opens in advance would be logged with a traceback.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    listener = open_socket(port)
    client = Path(viser.__file__).parent / "client" / "build" / "index.html"
    try:
        admission = Admission(gate, refusals, check_message, f"viser-v{viser.__version__}", client)
        # viser has no option for a socket, for checks of requests or for the size of messages.
        with _START_LOCK, _replaced_serve(_infra, admission, listener), contextlib.redirect_stdout(io.StringIO()):
            server = viser.ViserServer(host=HOST, port=port, label="taxel", verbose=False)
    except BaseException:
        listener.close()
        raise
    if not admission.is_installed:
        server.stop()
        listener.close()
        raise WebError(
            f"the page cannot be protected with viser {viser.__version__}; install the version that taxel requires: "
            "pip install 'taxel[web]'"
        )
    # A page can request a public address through a relay of viser. The page must stay on this computer.
    server.request_share_url = _disable_sharing  # type: ignore[method-assign]
    return server


@contextlib.contextmanager
def _replaced_serve(module: Any, admission: Any, listener: socket.socket) -> Iterator[None]:
    """Within the `with` block, replace the function with which `module` of viser starts its server.

    The replacement listens on the socket `listener` and uses the checks of `admission`. Another version of viser, which
    does not have this function, is left unchanged.
    """
    original: Any = getattr(module, "websockets", None)

    def serve(handler: Callable[[Any], Awaitable[None]], host: str, port: int, **options: Any) -> Any:
        """Start the server of the library websockets with the checks; replaces its function `serve`."""
        subprotocol = {name: options[name] for name in ("subprotocols", "select_subprotocol") if name in options}
        return original.asyncio.server.serve(handler, sock=listener, **subprotocol, **admission.get_options())

    if original is None:  # another version of viser, which `start_server` refuses
        yield
        return
    server = _Override(original.asyncio.server, serve=serve)
    module.websockets = _Override(original, asyncio=_Override(original.asyncio, server=server))
    try:
        yield
    finally:
        module.websockets = original


class _Override:
    """View of a module in which some names have other values; the module itself is not changed."""

    def __init__(self, module: Any, **names: Any) -> None:
        """Create a view of `module` in which `names` have other values."""
        self._module = module
        self.__dict__.update(names)

    def __getattr__(self, name: str) -> Any:
        """Return the module's value of a name that is not replaced."""
        return getattr(self._module, name)


def _disable_sharing(verbose: bool = True) -> None:
    """Do nothing: replaces viser's function that would share the page on the internet."""
