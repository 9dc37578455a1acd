//! Decodes the bytes of a serial line and counts the losses: `cargo run -p bodyflight-core --example decode`.

use bodyflight_core::link::{Decoder, Event, Header, Ledger, MAX_FRAME_LENGTH, Message, Stop};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Five messages, of which one loses a byte and one never arrives.
    let mut line = Vec::new();
    for sequence in 0..5 {
        let header = Header {
            session: 1,
            sequence,
            time: 4_167 * u64::from(sequence),
        };
        let mut frame = [0; MAX_FRAME_LENGTH];
        let message = Message::Stop(Stop { sent: sequence });
        let length = message
            .encode(&header, &mut frame)
            .map_err(|error| format!("{error:?}"))?;
        match sequence {
            1 => line.extend(frame[..length].iter().filter(|&&byte| byte != 0x01)),
            2 => {}
            _ => line.extend_from_slice(&frame[..length]),
        }
    }

    let mut decoder = Decoder::new();
    let mut ledger = Ledger::default();
    for byte in line {
        match decoder.push(byte) {
            Some(Event::Frame(header, message)) => {
                let arrival = ledger.receive(header.sequence);
                println!(
                    "{:3} us {:?}: {message:?} ({arrival:?})",
                    header.time, header.sequence
                );
            }
            Some(other) => println!("refused: {other:?}"),
            None => {}
        }
    }
    println!("{:?}", decoder.counters());
    Ok(())
}
