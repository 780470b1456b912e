# SPDX-License-Identifier: Apache-2.0
"""The module and what happens to its process: its end, Ctrl-C, fork().

Each test runs Python programs, which begin with PRELUDE. AF_LIBRARY_STUDY names the study's folder.
"""

import os
import signal
import subprocess
import sys
import time
import unittest

PRELUDE = """
import os, signal, sys, threading, time, warnings
import numpy as np
import attenuation_fields as af

study = os.environ["AF_LIBRARY_STUDY"]
fields = {name: f"{study}/{name}.af.h5" for name in ("AP", "LAT")}
hu = np.full((30, 36, 40), -1000, np.int16)
hu[5:25, 8:28, 8:30] = 200
ct = af.Ct(hu, (4, 4, 4), (-78, -70, -58))
camera = af.Camera("A", (0, -700, 0), (-126, 400, 126), (1, 0, 0), (0, 0, -1), (4, 4), (64, 64))

def opened(threads=1):
    return af.Field.open(fields["AP"], threads=threads)

def caster(threads=1, **options):
    return af.RayCaster(ct, camera, threads=threads, **options)

def case(threads=1):
    return af.RegistrationCase.load(f"{study}/study.toml", fields=fields, threads=threads)

def starts(loaded, count):
    return [loaded.frame.pose((0.1 * i % 3, 1, 2), (1, 2, 3)) for i in range(count)]
"""

# What a thread does over and over.
CALLS = {
    "drr": "made = caster(); call = made.drr",
    "drr of a field": "made = opened(); call = made.drr",
    "drr on two threads": "made = caster(2); call = made.drr",
    "gradient": "made = opened(); call = made.drr_and_gradient",
    "batch": "made = opened(2); call = lambda: made.drrs(np.zeros((40, 6)))",
    "registration": "made = case(); call = made.run",
    "registrations": "made = case(2); call = lambda: made.run_all(starts(made, 3))",
    "register": "call = lambda: af.register(f'{study}/study.toml', preset='fast', fields=fields)",
    "reading": "call = lambda: (opened(2), af.Ct.read(f'{study}/ct.nii.gz'))",
}


def program(*lines):
    return subprocess.Popen(
        [sys.executable, "-B", "-c", "\n".join([PRELUDE, *lines])],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


class EndTest(unittest.TestCase):
    def test_daemon_threads_do_not_disturb_the_end_of_python(self):
        for name, call in CALLS.items():
            for ending in ("", "sys.exit(3)"):
                with self.subTest(name, ending=ending):
                    run = program(
                        call,
                        "def work():",
                        "    while True: call()",
                        "for _ in range(3): threading.Thread(target=work, daemon=True).start()",
                        "time.sleep(0.3)",
                        "print('done', flush=True)",
                        ending,
                    )
                    output, errors = run.communicate(timeout=60)
                    self.assertEqual((run.returncode, errors), (3 if ending else 0, ""))
                    self.assertEqual(output, "done\n")


class InterruptTest(unittest.TestCase):
    """Ctrl-C raises KeyboardInterrupt within a second, and what was interrupted can be used again."""

    LONG = {
        "batch": (
            "made = opened()",
            "call = lambda: made.drrs(np.zeros((2000, 6)), out=np.empty((2000, *made.shape), np.float32))",
        ),
        "batch on two threads": ("made = caster(2)", "call = lambda: made.drrs(np.zeros((9000, 6)))"),
        "one drr": ("made = caster(step_mm=0.01)", "call = lambda: [made.drr() for _ in range(1)]"),
        "gradients": ("made = caster(2)", "call = lambda: made.drrs_and_gradients(np.zeros((2000, 6)))"),
        "registrations": ("made = case(2)", "call = lambda: made.run_all(starts(made, 5000))"),
        "a search": (
            "made = af.RegistrationCase.load(f'{study}/study.toml', renderer='raycast', threads=2)",
            "call = lambda: made.search(orientations='any')",
        ),
        "a registration": (
            "made = af.RegistrationCase.load(f'{study}/study.toml', renderer='raycast', step_mm=0.01)",
            "call = lambda: made.run(starts(made, 1)[0])",
        ),
    }

    def test_a_long_call_ends_by_ctrl_c(self):
        for name, (make, call) in self.LONG.items():
            with self.subTest(name):
                run = program(
                    make,
                    call,
                    "def value():",
                    "    if hasattr(made, 'drr'): return made.drr((1, 0, 0)).tobytes()",
                    "    return made.similarity(made.frame.pose((1, 0, 0)))",
                    "expected = value()",
                    "print('begun', flush=True)",
                    "try:",
                    "    while True: call()",
                    "except KeyboardInterrupt:",
                    "    ended = time.time()",
                    "assert value() == expected",
                    "print(ended)",
                )
                self.assertEqual(run.stdout.readline(), "begun\n")
                time.sleep(0.5)
                sent = time.time()
                run.send_signal(signal.SIGINT)
                output, errors = run.communicate(timeout=60)
                self.assertEqual((run.returncode, errors), (0, ""))
                # A call looks for Ctrl-C ten times a second. The rest is for a machine that has other work.
                self.assertLess(float(output) - sent, 1.0)

    def test_a_handler_may_raise_what_it_likes_and_others_let_the_call_go_on(self):
        run = program(
            "made = caster()",
            "heard = []",
            "signal.signal(signal.SIGUSR1, lambda *_: heard.append(made.drr().shape))",
            "def raising(*_): raise LookupError('enough')",
            "signal.signal(signal.SIGUSR2, raising)",
            "def send():",
            "    for number in (signal.SIGUSR1, signal.SIGUSR2):",
            "        time.sleep(0.4)",
            "        os.kill(os.getpid(), number)",
            "threading.Thread(target=send).start()",
            "try:",
            "    made.drrs(np.zeros((9000, 6)))",
            "except LookupError as error:",
            "    print(error, heard)",
        )
        output, errors = run.communicate(timeout=60)
        self.assertEqual((output, errors), ("enough [(64, 64)]\n", ""))


class ForkTest(unittest.TestCase):
    def test_a_copy_of_a_process_at_work_computes_or_says_why_not(self):
        for name, call in CALLS.items():
            with self.subTest(name):
                run = program(
                    call,
                    "other = caster(2)",
                    "expected = other.drr().tobytes()",
                    "def in_copy():",
                    "    assert other.drr().tobytes() == expected",
                    "    assert other.drrs(np.zeros((4, 6)))[3].tobytes() == expected",
                    "    assert caster(2).drr().tobytes() == expected",
                    "    for use in (call, opened, lambda: case().run()):",
                    "        try: use()",
                    "        except af.InputError as error:",
                    "            assert 'copy (fork) of one in which another thread' in str(error), error",
                    "            print('refused')",
                    "def work():",
                    "    while True: call()",
                    "threading.Thread(target=work, daemon=True).start()",
                    "warnings.simplefilter('ignore', DeprecationWarning)  # of fork() beside threads",
                    "for i in range(8):",
                    "    time.sleep(0.02)",
                    "    copy = os.fork()",
                    "    if copy == 0:",
                    "        signal.alarm(40)",
                    "        try: in_copy()",
                    "        except BaseException as error:",
                    "            print(repr(error), flush=True)",
                    "            os._exit(1)",
                    "        sys.stdout.flush()",
                    "        os._exit(0)",
                    "    status = os.waitpid(copy, 0)[1]",
                    "    if status != 0: sys.exit(f'copy {i}: status {status}')",
                )
                output, errors = run.communicate(timeout=300)
                self.assertEqual((run.returncode, errors), (0, ""), output)
                self.assertEqual(set(output.split("\n")) - {"refused", ""}, set())


if __name__ == "__main__":
    unittest.main()
