# SPDX-License-Identifier: Apache-2.0
"""Small HDF5 files in memory. A child process with little memory and time reads them, because libhdf5 does not survive
every damaged file. Its crash counts as an error in the file."""
import io
import json
import os
import resource
import signal

import h5py
import numpy as np

from af_programs.errors import FileError

MARK = b"\x89HDF\r\n\x1a\n"
MOST_NUMBERS = 16  # in a dataset that is read
MOST_TEXT_BYTES = 1024
MOST_BYTES_OF_CHILD = 1 << 30  # beyond what the parent has
MOST_SECONDS = 20


def is_hdf5(source):
    return source.head.startswith(MARK)


def datasets(source, groups_of):
    """The datasets in groups of a file: {"/group": {"name": value}}. A value is a list of numbers as (extents, numbers), a
    text, or None for anything else or anything too large. `groups_of(file)` names the groups, in the child process. Raises
    FileError for damaged files."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _answer(writer, source.path, groups_of)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        text = pipe.read()
    _, status = os.waitpid(child, 0)
    if status != 0 or not text:
        raise FileError(f"{source.name}: damaged HDF5: reading it crashed or took too long or too much memory")
    answer = json.loads(text)
    if "error" in answer:
        raise FileError(f"{source.name}: damaged HDF5: {answer['error']}")
    return answer["groups"]


def _answer(writer, path, groups_of):
    """Ends the process."""
    status = 1
    try:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS))
        with open("/proc/self/statm", encoding="ascii") as statm:
            size = int(statm.read().split()[0]) * resource.getpagesize() + MOST_BYTES_OF_CHILD
        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        try:
            with h5py.File(path, "r") as file:
                answer = {"groups": {name: {key: _value(file, f"{name}/{key}") for key in file[name or "/"]}
                                     for name in groups_of(file)}}
        except Exception as error:  # h5py raises any kind on damaged files
            answer = {"error": str(error)[:200]}
        with os.fdopen(writer, "wb") as pipe:
            pipe.write(json.dumps(answer).encode("utf-8", "replace"))
        status = 0
    finally:
        os._exit(status)


def _value(file, name):
    link = file.get(name, getlink=True)
    dataset = file[name] if isinstance(link, h5py.HardLink) else None
    if not isinstance(dataset, h5py.Dataset) or dataset.id.get_create_plist().get_external_count():
        return None
    kind = dataset.dtype.kind
    if kind in "iuf" and dataset.size is not None and dataset.size <= MOST_NUMBERS:
        return [list(dataset.shape), [float(value) for value in np.ravel(dataset[()])]]
    if kind == "S" and dataset.size == 1 and dataset.dtype.itemsize <= MOST_TEXT_BYTES or kind == "O" and dataset.size == 1:
        text = np.ravel(dataset[()])[0]
        return text.decode("utf-8", "replace")[:MOST_TEXT_BYTES] if isinstance(text, bytes) else str(text)[:MOST_TEXT_BYTES]
    # HDF5's C interface writes a text as characters of one byte.
    if kind in "iu" and dataset.dtype.itemsize == 1 and dataset.size <= MOST_TEXT_BYTES:
        return bytes(np.ravel(dataset[()])).rstrip(b"\0").decode("utf-8", "replace")
    return None


def file_bytes(fill):
    """The bytes of a file that `fill(file)` fills. Equal content gives equal bytes."""
    memory = io.BytesIO()
    with h5py.File(memory, "w", track_order=False) as file:
        fill(file)
    return memory.getvalue()
