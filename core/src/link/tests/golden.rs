//! Frames made by an independent implementation from the byte table: the wire never changes by accident.

use super::*;

const FRAMES: [&str; 13] = [
    "000c01010201feffffff0b943f010101010aefcdab896745230190055d0d036100",
    "000c01020201feffffff0b943f010101010defcdab8967452301930bf858010101010102010101020104ad\
     de900208030301040234120308f00101057bf4860900",
    "000c01030201feffffff0b943f0101010102010101037043010370420103e03f0103803f01034040010102\
     c001010102010111c03fbe12a0b6af0421436587f1071ae000",
    "000c01040201feffffff0b943f01010101020a010b28413d0ad73eec51b83d01010105cdcc4cbd01010115\
     0ad7233cec5138be0ad7233e7b142e3e0ad7233d010101216f1283ba6f12033b8fc2753d295c8f3d0ad7a3\
     3c3d0ad73e9a99993f6666e63f01076040e16be54000",
    "000c01050201feffffff0b943f0101010102010401ff7f01010105ada430da00",
    "000c01060201feffffff0b943f010101010601ab27807a00",
    "000c01070201feffffff0b943f0101010103201c01055fd51e3a00",
    "000c01080201feffffff0b943f01010101054598100900",
    "000c01090201feffffff0b943f01010101022001010546c91baf00",
    "000c010a0201feffffff0b943f01010101020101010101010101010101010201010dffffffffffffffff64\
     81eb1500",
    "000c01100201feffffff0b943f010101011a0fffbfffdfff4fffbfffdfff0fffbfffdfff0fffbfffdfff0f\
     4880ffdfff0fffbfffdfff0fffbfffdfff0fffbfffdfff0fffbfffdfff0fffbfffdfff0fffbfffdfff0fff\
     bfffdfff0fffbfffdfff0fffbfffdfff0fffbfffdfff0fbe12a0b6af04020202fb027c02fe010380c80105\
     209cdd6e00",
    "000c01110201feffffff0b943f01010101024d01010221010103803e01035cc20103604001010101010102\
     be01011a400ad7233c0ad7233d0ad7233c17b7d13817b7d13817b7d138010318410107c0bfcdcccc3d0101\
     010101067040c0c20405f452e3ac00",
    "000c01120201feffffff0b943f010101010104879303010101020101010202010102030101020401010205\
     010102060101020701010208010102090101020a0101020b0101020c0101020d0101020e0101020f010102\
     100101021101010212010102130101021401010215010102160101021701010218010105175e58f900",
];

#[test]
fn every_message_has_its_golden_frame() {
    for (message, expected) in examples().iter().zip(FRAMES) {
        let frame = frame_of(&header(), message);
        let hex: std::string::String = frame.iter().map(|b| std::format!("{b:02x}")).collect();
        assert_eq!(hex, expected, "{}", message.name());
        let bytes: std::vec::Vec<u8> = (0..expected.len() / 2)
            .map(|i| u8::from_str_radix(&expected[2 * i..2 * i + 2], 16).unwrap())
            .collect();
        assert_eq!(Message::decode(&bytes), Ok((header(), *message)));
    }
}
