"""Decoding of the hub's byte stream into taxel frames, with loss counters and times on the host's clock."""

from taxel.stream.accounting import BoardCount, LossAccount
from taxel.stream.capture_decoder import CapturedBatch, CaptureDecoder, decode_capture
from taxel.stream.clock import ClockMap
from taxel.stream.decoder import Batch, StreamDecoder
from taxel.stream.frame_stream import FrameStream
from taxel.stream.frames import HubMessage, TaxelFrame
from taxel.stream.hub_client import HubClient, HubError, VersionError
from taxel.stream.native import NativeLibraryError
from taxel.stream.pump import Pump
from taxel.stream.ring import RingBuffer

__all__ = [
    "Batch",
    "BoardCount",
    "CaptureDecoder",
    "CapturedBatch",
    "ClockMap",
    "FrameStream",
    "HubClient",
    "HubError",
    "HubMessage",
    "LossAccount",
    "NativeLibraryError",
    "Pump",
    "RingBuffer",
    "StreamDecoder",
    "TaxelFrame",
    "VersionError",
    "decode_capture",
]
