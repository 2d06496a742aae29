#!/usr/bin/python3
"""One sheet of the images that `debias render SCENE --compare -o FOLDER` has left in FOLDER.

    python3 src/render/sheet.py FOLDER SHEET.png

Of each estimator: the image, a signed map of its error against the reference (blue: too low, red: too high), and
its name, relative error, samples and seconds. A crop at one pixel per pixel: averaging pixels would hide noise.
"""
import json
import sys

import matplotlib
import numpy
from PIL import Image, ImageDraw, ImageFont

TILE, GAP, TEXT = 176, 6, 34


def read_pfm(path):
    with open(path, "rb") as file:
        channels = 3 if file.readline().strip() == b"PF" else 1
        width, height = map(int, file.readline().split())
        file.readline()
        values = numpy.fromfile(file, "<f4", width * height * channels)
    return numpy.broadcast_to(values.reshape(height, width, channels)[::-1].astype(float), (height, width, 3))


def srgb(linear):
    x = numpy.clip(linear, 0, 1)
    return numpy.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def error_map(error, scale):
    e = numpy.clip(error / scale, -1, 1)
    e = e[:, :, 0]
    return numpy.stack([1 - numpy.maximum(-e, 0), 1 - numpy.abs(e), 1 - numpy.maximum(e, 0)], axis=2)


def main(folder, output):
    with open(folder + "/index.json") as file:
        index = json.load(file)
    reference = read_pfm(folder + "/reference.pfm")
    cloud = index["scene"] == "transmittance"
    # Where something is to be seen: the middle of the dark, or of the bright, part.
    weight = numpy.abs(reference[:, :, 0] - numpy.median(reference))
    y, x = (int((weight * grid).sum() / weight.sum()) for grid in numpy.indices(weight.shape))
    y = min(max(y - TILE // 2, 0), max(weight.shape[0] - TILE, 0))
    x = min(max(x - TILE // 2, 0), max(weight.shape[1] - TILE, 0))
    crop = (slice(y, y + TILE), slice(x, x + TILE))
    background = read_pfm(folder + "/background.pfm") if cloud else numpy.ones(reference.shape)
    exposure = 1 if cloud else 0.15 / numpy.median(reference)
    scale = 0.1 if cloud else numpy.median(reference)

    whole = numpy.uint8(255 * srgb(exposure * reference * background))
    whole = numpy.asarray(Image.fromarray(whole).resize((TILE, TILE), Image.Resampling.BOX)) / 255
    background, reference = background[crop], reference[crop]
    tiles = [("reference", "by quadrature; below, all of it", srgb(exposure * reference * background), whole)]
    for p in index["pictures"]:
        image = read_pfm(folder + "/" + p["name"] + ".pfm")[crop]
        line = "%serror %.2g, " % ("biased, " if p["biased"] else "", p["error"])
        line += "%d spp, %.1f s" % (p["samples"], p["seconds"]) if cloud else "%.2gM photons" % (p["photons"] / 1e6)
        tiles.append((p["name"], line, srgb(exposure * image * background), error_map(image - reference, scale)))

    columns = min(len(tiles), 5 if cloud else 4)
    rows = -(-len(tiles) // columns)
    cell = (TILE + GAP, 2 * TILE + TEXT + 2 * GAP)
    sheet = Image.new("RGB", (columns * cell[0] + GAP, rows * cell[1] + GAP), "white")
    draw = ImageDraw.Draw(sheet)
    font = [ImageFont.truetype(matplotlib.get_data_path() + "/fonts/ttf/" + name, 10)
            for name in ("DejaVuSans-Bold.ttf", "DejaVuSans.ttf")]
    for i, (title, line, image, errors) in enumerate(tiles):
        at = (GAP + i % columns * cell[0], GAP + i // columns * cell[1])
        draw.text(at, title, "black", font[0])
        draw.text((at[0], at[1] + 15), line, "black", font[1])
        for k, picture in enumerate((image, errors)):
            pixels = numpy.uint8(numpy.round(255 * picture))
            sheet.paste(Image.fromarray(pixels), (at[0], at[1] + TEXT + k * (TILE + GAP)))
    at = (GAP + (columns - 1) * cell[0], GAP + (rows - 1) * cell[1])
    if len(tiles) < columns * rows:
        draw.text(at, "above the image, below its\nerror: red too high, blue too low,\nwhite right; full colour from\n"
                  "%s on" % ("0.1 of the light" if cloud else "the median irradiance"), "black", font[1])
    sheet.quantize(96, dither=Image.Dither.NONE).save(output, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
