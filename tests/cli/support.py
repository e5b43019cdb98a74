"""Runs the program and writes small inputs. Standard library only."""
import fcntl
import json
import os
import pty
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time
import unittest
import unittest.mock

PROGRAM = os.environ.get("OCTRAD", "octrad")
FAULTS = os.path.join(os.path.dirname(os.path.abspath(PROGRAM)), "liboctrad_faults.so")  # tests/faults.cc
NO_FAULTS = "" if os.path.exists(FAULTS) else f"SKIPPED: {FAULTS} was not built"
PATIENCE = 600  # seconds after which something hangs: no busy machine takes that long


class Result:
    def __init__(self, done):
        self.code = done.returncode
        self.out = done.stdout.decode("utf-8", "replace")
        self.err = done.stderr.decode("utf-8", "replace")

    def json(self):
        return json.loads(self.out)


def run(*arguments, timeout=PATIENCE, cwd=None, stdout=subprocess.PIPE):
    done = subprocess.run([PROGRAM, *map(str, arguments)], stdout=stdout, stderr=subprocess.PIPE, timeout=timeout, cwd=cwd)
    if done.stdout is None:
        done.stdout = b""
    return Result(done)


# The peak of a child begins at what its parent holds, which is more than small runs take: a bare interpreter starts the
# program, ends it when it hangs, and writes what it took. SIGPIPE and SIGXFSZ are as the interpreter found them.
MEASURE = """import os, signal, sys
report, seconds, *command = sys.argv[1:]
os.set_inheritable(int(report), False)
child = os.posix_spawnp(command[0], command, os.environ, setsigdef=[signal.SIGPIPE, signal.SIGXFSZ])
signal.signal(signal.SIGALRM, lambda *_: os.kill(child, signal.SIGKILL))
signal.alarm(int(seconds))
_, status, usage = os.wait4(child, 0)
os.write(int(report), b"%d %d %f" % (os.waitstatus_to_exitcode(status), 1024 * usage.ru_maxrss, usage.ru_utime + usage.ru_stime))"""


def measured(*arguments, hangs_after=PATIENCE, **keywords):
    """Runs the program: its exit code (negative: a signal), the peak of its resident memory in bytes, its processor seconds."""
    reading, writing = os.pipe()
    try:
        subprocess.run([sys.executable, "-I", "-S", "-c", MEASURE, str(writing), str(hangs_after), PROGRAM, *map(str, arguments)], pass_fds=(writing,), check=True, **keywords)
    finally:
        os.close(writing)
        with os.fdopen(reading, "rb") as report:
            text = report.read()
    code, peak, seconds = text.split()
    return int(code), int(peak), float(seconds)


def processor_seconds(pid):
    """Of a process that runs, or is stopped."""
    with open("/proc/%d/stat" % pid) as stat:
        return sum(map(int, stat.read().rsplit(")")[1].split()[11:13])) / os.sysconf("SC_CLK_TCK")


def children_seconds():
    """Processor seconds of all that was started and has ended."""
    return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def write_hdr(path, width, height, pixel):
    """Radiance HDR without run lengths; pixel(x, y) -> (r, g, b), each 0 or a power of two to be exact."""
    with open(path, "wb") as out:
        out.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {height} +X {width}\n".encode())
        for y in range(height):
            for x in range(width):
                rgb = pixel(x, y)
                peak = max(rgb)
                if peak <= 0:
                    out.write(bytes(4))
                    continue
                exponent = 0
                while peak >= 1.0:
                    peak, exponent = peak / 2, exponent + 1
                while peak < 0.5:
                    peak, exponent = peak * 2, exponent - 1
                out.write(bytes(int(v * 2.0 ** (8 - exponent)) for v in rgb) + bytes([exponent + 128]))


def write_pfm(path, width, height, pixel):
    """Portable float map: any float, exactly; pixel(x, y) -> (r, g, b)."""
    with open(path, "wb") as out:
        out.write(f"PF\n{width} {height}\n-1.0\n".encode())
        for y in reversed(range(height)):
            for x in range(width):
                out.write(struct.pack("<3f", *pixel(x, y)))


def write_safetensors(path, tensors, metadata):
    """tensors: name -> (dtype, shape, bytes)."""
    header, data = {"__metadata__": metadata}, b""
    for name, (dtype, shape, raw) in tensors.items():
        header[name] = {"dtype": dtype, "shape": shape, "data_offsets": [len(data), len(data) + len(raw)]}
        data += raw
    text = json.dumps(header).encode()
    with open(path, "wb") as out:
        out.write(struct.pack("<Q", len(text)) + text + data)


class Case(unittest.TestCase):
    """A test with a folder of its own. GPUs are hidden unless it is about them: the CPU repeats every bit."""
    sees_gpus = False

    def setUp(self):
        if not self.sees_gpus:
            hidden = unittest.mock.patch.dict(os.environ, CUDA_VISIBLE_DEVICES="")
            hidden.start()
            self.addCleanup(hidden.stop)
        self.folder = tempfile.mkdtemp(prefix="octrad-cli-")
        self.addCleanup(shutil.rmtree, self.folder, True)

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, text):
        with open(self.path(name), "w", encoding="utf-8") as out:
            out.write(text)
        return self.path(name)

    def ok(self, *arguments, **keywords):
        result = run(*arguments, **keywords)
        self.assertEqual(result.code, 0, f"{arguments}\n{result.err}")
        return result

    def fails(self, code, text, *arguments, **keywords):
        """The exit code, one message that contains `text`, and nothing on standard output."""
        result = run(*arguments, **keywords)
        self.assertEqual(result.code, code, f"{arguments}\n{result.out}\n{result.err}")
        self.assertIn("octrad: error: ", result.err)
        self.assertIn(text, result.err)
        self.assertEqual(result.out, "")
        return result


# A closed box with a lamp, a rough-metal and a mirror-like patch: quick, and every layer has something in it.
ROOM = """<scene version="3.0.0">
  <default name="spp" value="4"/>
  <default name="wall" value="0.5"/>
  <integrator type="path"><integer name="max_depth" value="6"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="60"/>
    <transform name="to_world"><lookat origin="0, 0, 0.9" target="0, -0.2, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/><rfilter type="box"/></film>
  </sensor>
  <bsdf type="twosided" id="white"><bsdf type="diffuse"><rgb name="reflectance" value="$wall, 0.5, 0.4"/></bsdf></bsdf>
  <bsdf type="twosided" id="metal"><bsdf type="roughconductor"><string name="distribution" value="ggx"/><float name="alpha" value="0.2"/></bsdf></bsdf>
  <shape type="cube" id="room"><ref id="white"/></shape>
  <shape type="rectangle" id="patch">
    <transform name="to_world"><scale value="0.5"/><translate x="0" y="0" z="-0.9"/></transform>
    <ref id="metal"/>
  </shape>
  <shape type="rectangle" id="lamp">
    <transform name="to_world"><rotate x="1" angle="90"/><scale value="0.3"/><translate x="0" y="0.95" z="0"/></transform>
    <ref id="white"/>
    <emitter type="area"><rgb name="radiance" value="8, 8, 8"/></emitter>
  </shape>
</scene>
"""

# A cache that trains in a second.
SMALL = ("-D", "train.points=256", "-D", "train.directions=2", "-D", "octree.levels=3", "-D", "decoder.width=32", "-D", "decoder.hidden=2",
         "-D", "train.poses=4", "-q")
# Nothing that depends on the share of the budget: 5 and 3 steps are 8.
FIXED = ("-D", "adam.decay.start=1", "-D", "adam.rate.budget=0", "-D", "loss.epsilon.first=0.05", "-D", "loss.epsilon.last=0.05")


def read_safetensors(path):
    """-> metadata, {name: bytes}"""
    with open(path, "rb") as file:
        raw = file.read()
    size = struct.unpack("<Q", raw[:8])[0]
    header = json.loads(raw[8:8 + size])
    metadata = header.pop("__metadata__")
    return metadata, {name: raw[8 + size + t["data_offsets"][0]:8 + size + t["data_offsets"][1]] for name, t in header.items()}


def edit_metadata(path, change):
    """Writes a model anew with what `change` makes of its metadata, without checksums, as the oldest ones are."""
    with open(path, "rb") as file:
        raw = file.read()
    size = struct.unpack("<Q", raw[:8])[0]
    header = json.loads(raw[8:8 + size])
    header["__metadata__"].pop("octrad.checksums")
    change(header["__metadata__"])
    text = json.dumps(header).encode()
    with open(path, "wb") as out:
        out.write(struct.pack("<Q", len(text)) + text + raw[8 + size:])


def start(*arguments, program=None):
    """A process to send signals to, also where the tests run under nohup; its error output is kept."""
    return subprocess.Popen([program or PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL))


def on_terminal(columns, *arguments, timeout=PATIENCE, enough=None):
    """What the program writes to a terminal of that width; it is interrupted once that is `enough`."""
    controller, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    process = subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, stderr=terminal, env=dict(os.environ, TERM="xterm"))
    os.close(terminal)
    text, end = b"", time.monotonic() + timeout
    while time.monotonic() < end:
        try:
            block = os.read(controller, 65536)
        except OSError:  # the program closed its end
            break
        if not block:
            break
        text += block
        if enough and enough(text.decode("utf-8", "replace")):
            process.send_signal(signal.SIGINT)
            enough = None
    process.communicate(timeout=PATIENCE)
    os.close(controller)
    return text.decode("utf-8", "replace")


def holds(file, text):
    """Whether the file is there and has this text."""
    if not os.path.exists(file):
        return False
    with open(file, encoding="utf-8") as content:
        return text in content.read()


def wait_for(condition, seconds=PATIENCE):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False
