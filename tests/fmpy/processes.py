"""Runs a function in a process of its own: a crash becomes a failed test, and addresses differ where that matters."""

import multiprocessing
import signal


def _child(pipe, function, arguments):
    try:
        pipe.send((True, function(*arguments)))
    except BaseException as error:  # carried over to the parent, whatever it is
        pipe.send((False, f"{type(error).__name__}: {error}"))


def in_process(function, *arguments, fresh=False):
    """Result of `function(*arguments)`; `fresh` starts a new interpreter in place of a fork."""
    context = multiprocessing.get_context("spawn" if fresh else "fork")
    ours, theirs = context.Pipe(duplex=False)
    child = context.Process(target=_child, args=(theirs, function, arguments))
    child.start()
    theirs.close()
    try:
        good, result = ours.recv()
    except EOFError:
        child.join()
        code = child.exitcode
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        raise AssertionError(f"the process ended in {function.__name__}: {how}") from None
    child.join()
    assert good, result
    return result
