#!/usr/bin/env python3
"""Makes the weights of LPIPS that `octrad compare --lpips-weights DIR` reads (docs/formats.md) from the published files:

    torchvision's network    https://download.pytorch.org/models/alexnet-owt-7be5be79.pth      (or squeezenet1_1-b8a52dc0.pth)
    the linear part          the wheel of PyPI's package lpips (pip download --no-deps lpips), or its weights/v0.1/alex.pth

    scripts/convert_lpips.py --network alexnet-owt-7be5be79.pth --linear lpips-0.1.4-py3-none-any.whl -o DIR

Needs the standard library alone: the files are read without PyTorch, and nothing in them is executed."""
import argparse
import array
import collections
import io
import json
import math
import os
import pickle
import struct
import sys
import tempfile
import zipfile

FIRES = ((3, 64, 16, 64), (4, 128, 16, 64), (6, 128, 32, 128), (7, 256, 32, 128), (9, 256, 48, 192), (10, 384, 48, 192), (11, 384, 64, 256), (12, 512, 64, 256))


def shapes(net):
    """Name -> shape of the tensors of a network, and those of its linear part."""
    network = {}

    def convolution(name, inputs, outputs, kernel):
        network[name + ".weight"] = (outputs, inputs, kernel, kernel)
        network[name + ".bias"] = (outputs,)

    if net == "alex":
        for number, inputs, outputs, kernel in ((0, 3, 64, 11), (3, 64, 192, 5), (6, 192, 384, 3), (8, 384, 256, 3), (10, 256, 256, 3)):
            convolution("features.%d" % number, inputs, outputs, kernel)
        taps = (64, 192, 384, 256, 256)
    else:
        convolution("features.0", 3, 64, 3)
        for number, inputs, squeeze, expand in FIRES:
            convolution("features.%d.squeeze" % number, inputs, squeeze, 1)
            convolution("features.%d.expand1x1" % number, squeeze, expand, 1)
            convolution("features.%d.expand3x3" % number, squeeze, expand, 3)
        taps = (64, 128, 256, 384, 384, 512, 512)
    return network, {"lin%d.model.1.weight" % i: (1, channels, 1, 1) for i, channels in enumerate(taps)}


class Tensor:
    """Where a tensor lies in a storage; its values are known when the storages are read."""
    def __init__(self, storage, offset, shape, stride, *_):
        self.key, self.offset, self.shape = storage, offset, tuple(shape)
        expected, step = [], 1
        for side in reversed(self.shape):
            expected.insert(0, step)
            step *= side
        if any(a != b for a, b, side in zip(stride, expected, self.shape) if side != 1):
            raise ValueError("a tensor is not contiguous")


class Reader(pickle.Unpickler):
    """Makes tensors and dictionaries, and nothing else."""
    def find_class(self, module, name):
        if (module, name) == ("collections", "OrderedDict"):
            return collections.OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return Tensor
        if (module, name) == ("torch._utils", "_rebuild_parameter"):
            return lambda tensor, *_: tensor
        if (module, name) == ("torch", "FloatStorage"):
            return "float32"
        raise ValueError("it holds %s.%s, which weights do not need" % (module, name))

    def persistent_load(self, saved):
        if saved[0] != "storage" or saved[1] != "float32":
            raise ValueError("its numbers are not 32-bit floats")
        return saved[2]


def read_torch(raw):
    """Name -> (shape, bytes) of a file that torch.save() wrote, in the format since 1.6 (a ZIP archive) or the one before."""
    storages = {}
    if raw[:2] == b"PK":
        archive = zipfile.ZipFile(io.BytesIO(raw))
        inside = next((name[:-len("data.pkl")] for name in archive.namelist() if name.endswith("data.pkl")), None)
        if inside is None:
            raise ValueError("the archive has no data.pkl")
        tensors = Reader(io.BytesIO(archive.read(inside + "data.pkl"))).load()
        for tensor in tensors.values():
            if tensor.key not in storages:
                storages[tensor.key] = archive.read(inside + "data/" + tensor.key)
    else:
        stream = io.BytesIO(raw)
        if Reader(stream).load() != 0x1950a86a20f9469cfc6c:
            raise ValueError("torch.save() did not write it")
        for _ in range(2):  # the format's version; about the machine that wrote it
            Reader(stream).load()
        tensors = Reader(stream).load()
        for key in Reader(stream).load():
            (count,) = struct.unpack("<q", stream.read(8))
            storages[key] = stream.read(4 * count)
    values = {}
    for name, tensor in tensors.items():
        size = 4 * math.prod(tensor.shape)
        data = storages[tensor.key][4 * tensor.offset:4 * tensor.offset + size]
        if len(data) != size:
            raise ValueError("tensor %s is cut off" % name)
        values[name] = (tensor.shape, data)
    return values


def read_file(path, inside):
    """The tensors of a .pth file, or of `inside` of a wheel."""
    try:
        with open(path, "rb") as file:
            raw = file.read()
        if path.endswith(".whl"):
            raw = zipfile.ZipFile(io.BytesIO(raw)).read(inside)
        return read_torch(raw)
    except OSError as error:
        sys.exit("%s: %s" % (path, error.strerror))
    except (ValueError, KeyError, AttributeError, TypeError, IndexError, EOFError, struct.error, pickle.UnpicklingError, zipfile.BadZipFile) as error:
        sys.exit("%s: cannot be read: %s" % (path, error))


def pick(tensors, wanted, path):
    chosen = {}
    for name, shape in wanted.items():
        if name not in tensors:
            sys.exit("%s: has no tensor %s: is it of this network?" % (path, name))
        if tensors[name][0] != shape:
            sys.exit("%s: tensor %s is %s, not %s" % (path, name, list(tensors[name][0]), list(shape)))
        if not all(map(math.isfinite, array.array("f", tensors[name][1]))):
            sys.exit("%s: tensor %s has values that are not finite" % (path, name))
        chosen[name] = tensors[name]
    return chosen


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--net", choices=("alex", "squeeze"), default="alex", help="the network (default: alex)")
    parser.add_argument("--network", required=True, metavar="FILE", help="torchvision's file of the network, .pth")
    parser.add_argument("--linear", required=True, metavar="FILE", help="the wheel of the package lpips, or its file of the network, .pth")
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="folder for the result")
    options = parser.parse_args()
    network, linear = shapes(options.net)
    tensors = pick(read_file(options.network, None), network, options.network)
    tensors.update(pick(read_file(options.linear, "lpips/weights/v0.1/%s.pth" % options.net), linear, options.linear))
    header, offset = {"__metadata__": {"net": options.net, "lpips_version": "0.1"}}, 0
    for name, (shape, data) in tensors.items():
        header[name] = {"dtype": "F32", "shape": list(shape), "data_offsets": [offset, offset + len(data)]}
        offset += len(data)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    file = os.path.join(options.output, "lpips_%s_v0.1.safetensors" % options.net)
    try:
        os.makedirs(options.output, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=options.output, delete=False) as out:
            out.write(struct.pack("<Q", len(text)) + text + b"".join(data for _, data in tensors.values()))
        os.chmod(out.name, 0o644)
        os.replace(out.name, file)
    except OSError as error:
        sys.exit("%s: %s" % (file, error.strerror))
    print("wrote %s" % file)


if __name__ == "__main__":
    main()
