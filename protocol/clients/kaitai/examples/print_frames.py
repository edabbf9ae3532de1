"""Print the frames of a capture: python print_frames.py skin.bin, beside the classes that the compiler has written."""

import sys
from itertools import pairwise

from taxel_capture import TaxelCapture
from taxel_stream import TaxelStream

data = b"".join(record.bytes for record in TaxelCapture.from_file(sys.argv[1]).records)
sequences = []
for entry in TaxelStream.from_bytes(data).frames.entries:
    sequences.append(entry.body.sequence)
    if entry.is_known:
        print(entry.body.type.name, {k: v for k, v in vars(entry.body.payload).items() if not k.startswith("_")})
print(sum((after - before - 1) % 65536 for before, after in pairwise(sequences)), "frames lost")
