"""Ctrl-C while compiled code runs: the process ends, with one line and no traceback."""

import os
import signal
import subprocess
import sys
import time

import pytest

from tendonff.compensator.files.writing import write_csv

LONG = """
import ctypes, threading, time
from tendonff.compensator.cli import main
from tendonff.compensator.identification import run as identification

def clean(*args, **kwargs):
    # What Python would wait for when it takes itself down.
    threading.Thread(target=time.sleep, args=(600,), daemon=False).start()
    print("in compiled code", flush=True)
    ctypes.CDLL(None).sleep(600)  # called as the compiled chains are
    raise AssertionError("it came back")

identification.clean = clean
main()
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_ctrl_c_leaves_compiled_code(examples, tmp_path, record_property):
    clock = [0.01 * k for k in range(100)]
    tension = [30 + 10 * t for t in clock]
    write_csv(tmp_path / "a.csv", {"time_s": clock, "input_tension_N": tension, "output_tension_N": clock})
    words = ["identify", str(examples / "finger.toml"), "--data", str(tmp_path / "a.csv")]
    command = [sys.executable, "-c", LONG, *words, "--out", str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            while process.poll() is None and "in compiled code" not in process.stdout.readline():
                pass
            process.send_signal(signal.SIGINT)
            start = time.perf_counter()
            said = process.communicate(timeout=60)[1]  # the call itself takes ten minutes
            record_property("figure", f"Ctrl-C in compiled code: ended after {time.perf_counter() - start:.2f} s")
        finally:
            process.kill()
    assert process.returncode == 130
    assert "Traceback" not in said
    assert said.strip().endswith("interrupted; nothing was written")
    assert not (tmp_path / "out").exists()
