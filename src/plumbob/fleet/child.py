"""A process of its own for jobs of a batch: the end that the batch holds, and what runs in it.

Most of a job on a short recording is Python, which holds the interpreter's lock, so that two threads take as long as
one. A child imports this package and never the program that called `plumbob.batch`: a script needs no main guard, and a
notebook or a prompt will do. Jobs come over its standard input and outcomes go over its standard output, each pickled
behind its length; whatever else is printed in it goes to standard error.

A child ends with the end of its input, thus also where the batch was killed, and by SIGTERM: both break off the job
that runs. It has a session of its own, so that Ctrl-C in a terminal or a notebook is for the batch, which ends its
children.
"""

import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Any, Final

from plumbob.fleet.items import Item
from plumbob.fleet.job import JobOutcome, StoppedError, run_job
from plumbob.fleet.settings import BatchSettings

_LENGTH: Final = struct.Struct("<Q")
_CODE: Final = "import sys; sys.path[:] = sys.argv[1:]; from plumbob.fleet.child import main; main()"
_BEGIN: Final = b"\0plumbob\n"
"""Ends what start-up files of Python may have printed to the pipe of the answers."""
_READY: Final = "ready"
_NOT_TAKEN: Final = "not taken"


class EndedError(Exception):
    """The child has ended; the text says how."""


class NotTakenError(Exception):
    """The recording cannot be handed over: its type is known in this process alone."""


class Child:
    """A process that does one job at a time.

    Parameters
    ----------
    settings : BatchSettings
        Of the batch.
    out : str
        Path or URL of the dataset.

    Raises
    ------
    OSError
        If the system starts no further process, or this interpreter cannot be started again.
    """

    def __init__(self, settings: BatchSettings, out: str) -> None:
        if not sys.executable or getattr(sys, "frozen", False):
            raise OSError("this interpreter is part of another program")
        self._process = subprocess.Popen(
            [sys.executable, "-c", _CODE, *(str(path) or str(Path.cwd()) for path in sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),  # of Windows: no Ctrl-C there either
        )
        self._first: Any = settings, out
        self.pid = self._process.pid

    def ready(self) -> bool:
        """Wait until it can work; False where it has ended before."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.endswith(_BEGIN):
                break
        with suppress(EndedError):
            return bool(self._answer(pickle.dumps(self._first)) == _READY)
        return False

    def run(self, item: Item) -> JobOutcome:
        """Let it do a job.

        Raises
        ------
        EndedError
            If it ended meanwhile.
        NotTakenError
            If the recording cannot be pickled.
        Exception
            As of `plumbob.fleet.job.run_job`.
        """
        try:
            data = pickle.dumps(item, pickle.HIGHEST_PROTOCOL)
        except Exception as error:  # whatever a foreign type raises
            raise NotTakenError from error
        answer = self._answer(data)
        if isinstance(answer, Exception):
            raise answer
        if answer == _NOT_TAKEN:
            raise NotTakenError
        assert isinstance(answer, JobOutcome)
        return answer

    def stop(self) -> None:
        """Ask it to break off what it does, and to end; on Windows it is ended."""
        self._process.terminate()

    def end(self, patience: float) -> None:
        """Wait for its end, s, and see to it."""
        try:
            self._process.wait(patience)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def close(self) -> None:
        """Close the pipes of a child that has ended, and that no thread waits for."""
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                pipe.close()  # type: ignore[union-attr]

    def _answer(self, data: bytes) -> Any:
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            _send(self._process.stdin, data)
            return pickle.loads(_received(self._process.stdout))  # noqa: S301 - from our own child, over its own pipe
        except (OSError, EOFError) as error:
            self.end(1.0)
            raise EndedError(_how(self._process.returncode)) from error


def _how(code: int) -> str:
    """What an exit code says."""
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"was ended by {name}" + (", as the system does where memory runs out" if name == "SIGKILL" else "")


def _send(pipe: IO[bytes], data: bytes) -> None:
    pipe.write(_LENGTH.pack(len(data)))
    pipe.write(data)
    pipe.flush()


def _received(pipe: IO[bytes]) -> bytes:
    """Next message; EOFError where none comes any more."""
    head = pipe.read(_LENGTH.size)
    size = _LENGTH.unpack(head)[0] if len(head) == _LENGTH.size else -1
    data = pipe.read(size) if size >= 0 else b""
    if len(data) != size:
        raise EOFError
    return data


# In the child ---------------------------------------------------------------------------------------------------------


def main() -> None:
    """Do the jobs that come, until no more can come."""
    work, answers = _own_pipes()
    stop, jobs, signals = threading.Event(), SimpleQueue[bytes | None](), list[int]()

    def end(number: int = 0, _frame: object = None) -> None:
        signals.append(number)
        stop.set()
        jobs.put(None)

    def listen() -> None:
        with suppress(EOFError, OSError):
            while True:
                jobs.put(_received(work))
        end()

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    threading.Thread(target=listen, daemon=True).start()
    with suppress(OSError, StoppedError):  # nobody listens any more, or wants it done
        if (first := jobs.get()) is not None:
            settings, out = pickle.loads(first)  # noqa: S301 - from the batch that started this process
            _send(answers, pickle.dumps(_READY))
            while (data := jobs.get()) is not None:
                _send(answers, _done(settings, data, out, stop))
    if any(signals):  # let the batch see by what this process was ended
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.raise_signal(signal.SIGTERM)
    os._exit(0)  # at once: there is nothing to write, and to take all apart costs a tenth of a second


def _own_pipes() -> tuple[IO[bytes], IO[bytes]]:
    """Pipes from and to the batch, under numbers that nothing else reads or prints to."""
    pipes = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with Path(os.devnull).open("r+b") as nothing:
        os.dup2(nothing.fileno(), 0)
        try:
            os.dup2(2, 1)
        except OSError:  # the batch has no standard error
            os.dup2(nothing.fileno(), 1)
    pipes[1].write(_BEGIN)
    pipes[1].flush()
    return pipes


def _done(settings: BatchSettings, data: bytes, out: str, stop: threading.Event) -> bytes:
    """Outcome of a job, or what it raised, pickled."""
    try:
        item = pickle.loads(data)  # noqa: S301 - as above
    except Exception:  # whatever the lack of a type raises
        return pickle.dumps(_NOT_TAKEN)
    try:
        return pickle.dumps(run_job(settings, item, out, stop))
    except StoppedError:
        raise
    except Exception as error:
        return _pickled(error)


def _pickled(error: Exception) -> bytes:
    """An error that the batch can unpickle, with the lines where it was raised as a note."""
    import traceback

    error.add_note("".join(traceback.format_exception(error)))
    try:
        data = pickle.dumps(error)
        pickle.loads(data)  # noqa: S301 - of the line above
    except Exception:  # some can be pickled in one direction alone
        return pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
    return data
