"""Children of `ccfem.body.isolated`, forked from processes that have imported what they need.

Each is a process of its own with its own limits, as those that ccfem starts; the imports alone,
nearly all of the work of reading a small file, are done once.
"""

import importlib
import json
import os
import select
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import numpy as np

MODULE = "ccfem.body.isolated.child"
IMPORTED = {
    "vtk_files": ("pyvista", "vtkmodules.vtkIOLegacy", "vtkmodules.vtkIOXdmf2"),
    "gmsh_files": ("meshio",),
    "gmsh_meshing": ("gmsh",),
    "ftetwild": ("pytetwild",),
}
"""What functions of a module import when they are called; each module has a process of its own."""


class ForkedChildren:
    """Stands for the module `subprocess` where `ccfem.body.isolated.process` starts children."""

    DEVNULL, TimeoutExpired = subprocess.DEVNULL, subprocess.TimeoutExpired

    def __init__(self):
        self._owner, self._lock, self._servers = os.getpid(), threading.Lock(), {}

    def run(self, command, *, cwd, env, timeout, **options):
        """Have a child forked, and wait for its end."""
        if command[-2] != MODULE or os.getpid() != self._owner:
            return subprocess.run(command, cwd=cwd, env=env, timeout=timeout, **options)
        with np.load(Path(cwd) / "in.npz") as file:
            module = str(file["function"]).split(":")[0]
        with self._lock:
            if module not in self._servers:
                words = [sys.executable, "-P", __file__, module]
                # Without buffers: `select` does not see a second line that was read with the first.
                self._servers[module] = subprocess.Popen(
                    words, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
                )
            ask, answer = self._servers[module].stdin, self._servers[module].stdout
            ask.write(json.dumps([cwd, env]).encode() + b"\n")
            child = int(answer.readline())
            late = not select.select([answer], [], [], timeout)[0]
            if late:
                with suppress(ProcessLookupError):
                    os.kill(child, 9)
            code = int(answer.readline())
        if late:
            raise subprocess.TimeoutExpired(command, timeout)
        return subprocess.CompletedProcess(command, code)

    def end(self):
        """End the processes from which the children come."""
        for server in self._servers.values():
            server.communicate()


def _child(main, folder, environment):
    """Do what the child does, and end with its exit code."""
    code = 1
    try:
        os.environ.clear()
        os.environ.update(environment)
        os.chdir(folder)
        sys.argv[1:] = [folder]
        main()
        code = 0
    except SystemExit as ended:
        code = ended.code or 0
    finally:
        os._exit(code)


def _serve():
    """Fork a child for each line that comes: say its number, and how it ended."""
    ask, answer = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb", buffering=0)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nowhere, stream)
    main = importlib.import_module(MODULE).main
    for name in IMPORTED.get(sys.argv[1], ()):
        with suppress(ImportError, OSError):  # the child says what is missing
            importlib.import_module(name)
    for line in ask:
        folder, environment = json.loads(line)
        child = os.fork()
        if not child:
            _child(main, folder, environment)
        answer.write(b"%d\n" % child)
        answer.write(b"%d\n" % os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))


if __name__ == "__main__":
    _serve()
