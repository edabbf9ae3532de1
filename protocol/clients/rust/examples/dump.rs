//! Prints decoded frames as text lines, which the tests compare with the decoder in Python.
//!
//!     dump capture FILE      the frames of a capture file, then its losses
//!     dump vectors           for each line of the standard input: "stream DIRECTIONS HEX", "register STRUCT HEX"
//!                            or "original FORMAT HEX"
use std::fmt::Write as _;
use std::io::{BufRead, BufWriter, Write};

use taxel_client::protocol::visit_struct;
use taxel_client::{encode_frame, CaptureReader, Decoder, Direction, Frame, OriginalDecoder, Value, ORIGINAL_FORMATS};

const BOARDS: usize = 112; // the addresses 0x08 to 0x77

/// Format bytes as hexadecimal digits.
fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{:02x}", byte)).collect()
}

/// Parse hexadecimal digits.
fn from_hex(text: &str) -> Vec<u8> {
    (0..text.len() / 2).map(|i| u8::from_str_radix(&text[2 * i..2 * i + 2], 16).unwrap()).collect()
}

/// Append " name=value" to a line.
fn push_field(line: &mut String, prefix: &str, name: &str, value: Value<'_>) {
    match value {
        Value::Number(number) => write!(line, " {}{}={}", prefix, name, number).unwrap(),
        Value::Bytes(bytes) => write!(line, " {}{}={}", prefix, name, to_hex(bytes)).unwrap(),
    }
}

/// Format a frame; `with_wire`: also its encoding from the decoded fields.
fn format_frame(frame: &Frame<'_>, with_wire: bool) -> String {
    let mut line = format!(
        "frame type={} sequence={} lost={} flags={}",
        frame.frame_type.name(),
        frame.sequence,
        frame.lost_before,
        frame.flags.0
    );
    let message = frame.message().unwrap();
    message.visit(&mut |prefix, name, value| push_field(&mut line, prefix, name, value));
    if let Some(taxels) = frame.taxels {
        let (missing, time) = (taxels.missing_before, taxels.board_time_us);
        write!(line, " missing={} board_time_us={} counts={}", missing, time, join(taxels.counts)).unwrap();
    } else {
        write!(line, " tail={}", to_hex(message.tail())).unwrap();
    }
    if with_wire {
        let (mut payload, mut wire) = (frame.payload.to_vec(), [0; 600]);
        message.pack(&mut payload);
        let size = encode_frame(frame.frame_type, frame.sequence, &payload, &mut wire).unwrap();
        write!(line, " wire={}", to_hex(&wire[..size])).unwrap();
    }
    line
}

/// Print the counters of a stream and of its boards, and the pending acknowledgements.
fn print_losses(decoder: &mut Decoder<BOARDS>, out: &mut impl Write) {
    let (losses, mut answers) = (decoder.losses(), [0; 66]);
    let size = decoder.take_acknowledgements(&mut answers);
    writeln!(
        out,
        "end frames={} lost={} restarts={} unknown={} discarded={} answers={}",
        losses.frames,
        losses.lost,
        losses.restarts,
        losses.unknown,
        decoder.discarded_bytes(),
        to_hex(&answers[..size])
    )
    .unwrap();
    let mut boards: Vec<_> = decoder.boards().collect();
    boards.sort_by_key(|board| board.address);
    for board in boards {
        writeln!(
            out,
            "board address={} received={} missing={} damaged={} undecoded={}",
            board.address, board.received, board.missing, board.damaged, board.undecoded
        )
        .unwrap();
    }
}

/// Print the frames and losses of a capture file.
fn dump_capture(path: &str, out: &mut impl Write) -> Result<(), String> {
    let content = std::fs::read(path).map_err(|error| format!("{}: {}", path, error))?;
    let mut decoder = Box::new(Decoder::<BOARDS>::new(Direction::TO_HOST));
    for record in CaptureReader::new(&content).map_err(|error| format!("{} {}", path, error))? {
        let record = record.map_err(|error| format!("{} {}", path, error))?;
        decoder.push(record.bytes, &mut |frame| writeln!(out, "{}", format_frame(frame, false)).unwrap());
    }
    decoder.finish(&mut |frame| writeln!(out, "{}", format_frame(frame, false)).unwrap());
    print_losses(&mut decoder, out);
    Ok(())
}

/// Format numbers with commas between them.
fn join<T: ToString>(numbers: &[T]) -> String {
    numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(",")
}

/// Print the messages of a stream of the original hub.
fn dump_original(name: &str, bytes: &[u8], out: &mut impl Write) {
    let format = ORIGINAL_FORMATS.iter().find(|format| format.name == name).unwrap();
    let mut decoder = OriginalDecoder::new(format);
    let mut lines = Vec::new();
    let mut print = |message: taxel_client::OriginalMessage<'_>| {
        lines.push(format!(
            "message address={} time={} plausible={} position={} counts={} accelerations={}",
            message.address,
            message.timestamp_ms.unwrap_or(0),
            message.is_time_plausible as u8,
            message.position,
            join(message.counts),
            join(message.accelerations)
        ));
    };
    let (first, second) = bytes.split_at(bytes.len() / 2); // the result does not depend on the pieces
    decoder.push(first, &mut print);
    decoder.push(second, &mut print);
    decoder.finish(&mut print);
    lines.push(format!(
        "end discarded={} rejected={} ambiguous={}",
        decoder.discarded_bytes(),
        decoder.rejected_candidates(),
        decoder.ambiguous_candidates()
    ));
    writeln!(out, "{}", lines.join("\n")).unwrap();
}

/// Print the decoded content of one line of the standard input.
fn dump_vector(kind: &str, which: &str, bytes: &[u8], out: &mut impl Write) {
    if kind == "register" {
        let (mut line, mut packed) = ("register".to_string(), vec![0; 600]);
        match visit_struct(which, bytes, &mut packed, &mut |name, value| push_field(&mut line, "", name, value)) {
            Some(size) => writeln!(out, "{} bytes={}", line, to_hex(&packed[..size])).unwrap(),
            None => writeln!(out, "unknown {}", which).unwrap(),
        }
        return;
    }
    if kind == "original" {
        return dump_original(which, bytes, out);
    }
    let mut decoder = Box::new(Decoder::<BOARDS>::new(Direction(which.parse().unwrap())));
    decoder.push(bytes, &mut |frame| writeln!(out, "{}", format_frame(frame, true)).unwrap());
    decoder.finish(&mut |frame| writeln!(out, "{}", format_frame(frame, true)).unwrap());
    print_losses(&mut decoder, out);
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let mut out = BufWriter::new(std::io::stdout());
    if arguments.len() == 3 && arguments[1] == "capture" {
        if let Err(problem) = dump_capture(&arguments[2], &mut out) {
            eprintln!("{}", problem);
            std::process::exit(1);
        }
        return;
    }
    for line in std::io::stdin().lock().lines() {
        let line = line.unwrap();
        let parts: Vec<&str> = line.split(' ').collect();
        dump_vector(parts[0], parts[1], &from_hex(parts[2]), &mut out);
    }
}
