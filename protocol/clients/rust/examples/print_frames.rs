// cargo run --release --example print_frames -- skin.bin
use taxel_client::{CaptureReader, Decoder, Direction, Frame};

fn print_frame(frame: &Frame<'_>) {
    if let Some(taxels) = frame.taxels.as_ref().filter(|taxels| !taxels.counts.is_empty()) {
        println!(
            "board 0x{:02X}, cycle {}: taxel 0 has {} counts",
            taxels.address, taxels.cycle, taxels.counts[0]
        );
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let content = std::fs::read(std::env::args().nth(1).unwrap_or_else(|| "skin.bin".into()))?;
    let mut decoder = Decoder::<112>::new(Direction::TO_HOST);
    for record in CaptureReader::new(&content).map_err(|error| error.to_string())? {
        decoder.push(record.map_err(|error| error.to_string())?.bytes, &mut print_frame);
    }
    decoder.finish(&mut print_frame); // a capture can end before the delimiter of its last frame
    println!("{} frames lost", decoder.losses().lost);
    Ok(())
}
