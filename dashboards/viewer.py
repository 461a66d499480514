"""Opening a recording in the rerun viewer, and taking its picture without a screen."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import rerun_cli
from rerun.experimental import ViewerClient

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_START_S: Final = 60.0
_TRIES: Final = 5
_TOAST_S: Final = 5.0


class ViewerFailed(RuntimeError):
    """The viewer did not start or did not load the recording."""


def executable() -> Path:
    """Return the viewer's binary; stopping the wrapper script would orphan it."""
    return Path(rerun_cli.__file__).with_name("rerun")


def open_viewer(recording: Path) -> int:
    """Show a recording in the viewer's window until it is closed; return its exit code."""
    return subprocess.call([executable(), recording])  # noqa: S603


def take_picture(
    recording: Path, picture: Path, *, size: str = "1920x1200", view: str | None = None
) -> list[str]:
    """Render a recording headless into a PNG.

    Parameters
    ----------
    recording : Path
        The .rrd file.
    picture : Path
        The PNG to write.
    size : str
        Window size, WIDTHxHEIGHT.
    view : str, optional
        Name of one view to take instead of the whole dashboard.

    Returns
    -------
    list of str
        What the viewer reported about its views and logged as warnings or errors.

    Raises
    ------
    ViewerFailed
        If the viewer does not start (no Vulkan driver, for one) or does not load the file.
    """
    with _headless(recording, size) as client:
        state = _wait(client, lambda s: bool(s.recordings and s.views and not s.loading))
        view_id = next((v.view_id for v in state.views if v.name == view), None)
        started_s = time.monotonic()
        _save(client, picture, view_id)  # makes the viewer fetch its data
        time.sleep(max(0.0, _TOAST_S - (time.monotonic() - started_s)))
        state = _wait(client, lambda s: not s.loading)
        _save(client, picture, view_id)
        complaints = [f"{v.name}: {report}" for v in state.views for report in v.reports]
        complaints += [
            f"{log.level}: {log.message}"
            for log in client.get_logs()
            if log.level in {"WARN", "ERROR"} and "rasterizer" not in log.message
        ]
        return complaints


def _save(client: Any, picture: Path, view_id: object) -> None:  # noqa: ANN401
    """Take one picture; a busy machine may need longer than the viewer waits."""
    for _ in range(_TRIES - 1):
        with contextlib.suppress(TimeoutError):
            client.save_screenshot(str(picture.absolute()), view_id)
            return
    try:
        client.save_screenshot(str(picture.absolute()), view_id)
    except TimeoutError as error:
        message = f"rerun viewer did not draw the recording in {_TRIES} tries"
        raise ViewerFailed(message) from error


@contextlib.contextmanager
def _headless(recording: Path, size: str) -> Iterator[Any]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [str(executable()), "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", size, "--hide-welcome-screen", str(recording)]
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)  # noqa: S603
        try:
            yield _connect(process, port)
        finally:
            process.terminate()
            process.wait(10)


def _connect(process: subprocess.Popen[bytes], port: int) -> Any:  # noqa: ANN401
    deadline_s = time.monotonic() + _START_S
    while time.monotonic() < deadline_s:
        if process.poll() is not None:
            message = (
                f"rerun viewer ended with code {process.returncode}; is a Vulkan driver installed?"
            )
            raise ViewerFailed(message)
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.get_state()
        except Exception:  # noqa: BLE001, S112 - the client raises whatever its transport raises
            time.sleep(0.1)
        else:
            return client
    message = f"rerun viewer did not answer within {_START_S:g} s"
    raise ViewerFailed(message)


def _wait(client: Any, ready: Callable[[Any], bool]) -> Any:  # noqa: ANN401
    deadline_s = time.monotonic() + _START_S
    while time.monotonic() < deadline_s:
        state = client.get_state()
        if ready(state):
            return state
        time.sleep(0.1)
    message = f"rerun viewer did not load the recording within {_START_S:g} s"
    raise ViewerFailed(message)
