//! MCAP files: messages with times in compressed chunks, with indexes and a summary (<https://mcap.dev/spec>).
//!
//! Chunks are compressed with LZ4. The crate that the format's authors publish compresses by C libraries only.

mod record;

use std::collections::BTreeMap;
use std::io::{self, Write};

use lz4_flex::frame::FrameEncoder;

use self::record::{Kind, Record};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Bytes in a chunk before compression: a reader decompresses one to reach a message.
const CHUNK: usize = 1 << 20;
/// Name of the compression in the format.
const COMPRESSION: &[u8] = b"lz4";

/// A channel, in the order of creation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChannelId(u16);

/// What is known of a channel.
struct Channel {
    record: Vec<u8>,
    messages: u32,
    /// Times (ns) and places of its messages in the open chunk.
    index: Vec<(u64, u64)>,
}

/// First and last time (ns).
#[derive(Debug, Clone, Copy)]
struct Span([u64; 2]);

impl Span {
    const EMPTY: Self = Self([u64::MAX, 0]);

    fn of(self, time: u64) -> Self {
        Self([self.0[0].min(time), self.0[1].max(time)])
    }

    /// Zero for both if there is no message.
    fn ends(self) -> [u64; 2] {
        if self.0[0] > self.0[1] {
            [0, 0]
        } else {
            self.0
        }
    }
}

/// A file that is being written.
pub struct McapFile<W: Write> {
    out: W,
    place: u64,
    schemas: Vec<Vec<u8>>,
    channels: Vec<Channel>,
    chunk: Vec<u8>,
    chunk_span: Span,
    span: Span,
    chunk_indexes: Vec<Vec<u8>>,
    metadata_indexes: Vec<Vec<u8>>,
}

impl<W: Write> McapFile<W> {
    /// Starts a file that the program `library` writes.
    ///
    /// # Errors
    /// Returns an error if writing fails.
    pub fn new(out: W, library: &str) -> io::Result<Self> {
        let mut file = Self {
            out,
            place: 0,
            schemas: Vec::new(),
            channels: Vec::new(),
            chunk: Vec::with_capacity(CHUNK),
            chunk_span: Span::EMPTY,
            span: Span::EMPTY,
            chunk_indexes: Vec::new(),
            metadata_indexes: Vec::new(),
        };
        file.put(MAGIC)?;
        let header = Record::new(Kind::Header).counted(b"");
        file.put(&header.counted(library.as_bytes()).done())?;
        Ok(file)
    }

    /// Writes texts by name.
    ///
    /// # Errors
    /// Returns an error if writing fails.
    pub fn metadata(&mut self, name: &str, texts: &BTreeMap<String, String>) -> io::Result<()> {
        let record = Record::new(Kind::Metadata).counted(name.as_bytes());
        let record = record.texts(texts).done();
        let index = Record::new(Kind::MetadataIndex)
            .u64(self.place)
            .u64(record.len() as u64)
            .counted(name.as_bytes());
        self.metadata_indexes.push(index.done());
        self.put(&record)
    }

    /// Adds a channel of Protocol Buffers; `schema` is its `FileDescriptorSet`.
    pub fn channel(&mut self, topic: &str, (name, schema): (&str, &[u8])) -> ChannelId {
        let id = u16::try_from(self.channels.len()).unwrap_or(u16::MAX);
        // A schema belongs to each channel; the format reserves 0.
        let schema_id = id.saturating_add(1);
        let schema = Record::new(Kind::Schema)
            .u16(schema_id)
            .counted(name.as_bytes())
            .counted(b"protobuf")
            .counted(schema)
            .done();
        let record = Record::new(Kind::Channel)
            .u16(id)
            .u16(schema_id)
            .counted(topic.as_bytes())
            .counted(b"protobuf")
            .texts(&BTreeMap::new())
            .done();
        self.chunk.extend(&schema);
        self.chunk.extend(&record);
        self.schemas.push(schema);
        self.channels.push(Channel {
            record,
            messages: 0,
            index: Vec::new(),
        });
        ChannelId(id)
    }

    /// Writes a message at a time (ns).
    ///
    /// # Errors
    /// Returns an error if writing fails.
    pub fn message(&mut self, ChannelId(id): ChannelId, time: u64, data: &[u8]) -> io::Result<()> {
        let Some(channel) = self.channels.get_mut(usize::from(id)) else {
            return Err(io::Error::other("the channel is of another file"));
        };
        channel.index.push((time, self.chunk.len() as u64));
        let record = Record::new(Kind::Message)
            .u16(id)
            .u32(channel.messages)
            .u64(time)
            .u64(time)
            .bytes(data);
        channel.messages = channel.messages.wrapping_add(1);
        self.chunk.extend(record.done());
        self.chunk_span = self.chunk_span.of(time);
        self.span = self.span.of(time);
        if self.chunk.len() < CHUNK {
            return Ok(());
        }
        self.end_chunk()
    }

    /// Writes the open chunk and its index.
    fn end_chunk(&mut self) -> io::Result<()> {
        if self.chunk.is_empty() {
            return Ok(());
        }
        let compressed = compressed(&self.chunk)?;
        let [first, last] = self.chunk_span.ends();
        let (whole, packed) = (self.chunk.len() as u64, compressed.len() as u64);
        let chunk = Record::new(Kind::Chunk)
            .u64(first)
            .u64(last)
            .u64(whole)
            .u32(crc32fast::hash(&self.chunk))
            .counted(COMPRESSION)
            .u64(packed)
            .bytes(&compressed)
            .done();
        let place = self.place;
        self.put(&chunk)?;
        let after = self.place;
        let mut indexes = Vec::new();
        for (id, channel) in (0_u16..).zip(&mut self.channels) {
            if !channel.index.is_empty() {
                let index = Record::new(Kind::MessageIndex).u16(id);
                let entries = channel.index.drain(..);
                let index = index.list(entries, |list, (time, place)| list.u64(time).u64(place));
                indexes.push((id, index.done()));
            }
        }
        let mut places = Vec::new();
        for (id, index) in &indexes {
            places.push((*id, self.place));
            self.put(index)?;
        }
        let index = Record::new(Kind::ChunkIndex)
            .u64(first)
            .u64(last)
            .u64(place)
            .u64(chunk.len() as u64)
            .list(places, |list, (id, place)| list.u16(id).u64(place))
            .u64(self.place - after)
            .counted(COMPRESSION)
            .u64(packed)
            .u64(whole);
        self.chunk_indexes.push(index.done());
        self.chunk.clear();
        self.chunk_span = Span::EMPTY;
        Ok(())
    }

    fn statistics(&self) -> Vec<u8> {
        let count = |items: usize| u32::try_from(items).unwrap_or(u32::MAX);
        let messages = self
            .channels
            .iter()
            .map(|channel| u64::from(channel.messages));
        let [first, last] = self.span.ends();
        Record::new(Kind::Statistics)
            .u64(messages.clone().sum())
            .u16(u16::try_from(self.schemas.len()).unwrap_or(u16::MAX))
            .u32(count(self.channels.len()))
            .u32(0)
            .u32(count(self.metadata_indexes.len()))
            .u32(count(self.chunk_indexes.len()))
            .u64(first)
            .u64(last)
            .list((0_u16..).zip(messages), |list, (id, messages)| {
                list.u16(id).u64(messages)
            })
            .done()
    }

    /// Completes the file and returns its output.
    ///
    /// # Errors
    /// Returns an error if writing fails.
    pub fn finish(mut self) -> io::Result<W> {
        self.end_chunk()?;
        self.put(&Record::new(Kind::DataEnd).u32(0).done())?;
        let start = self.place;
        let mut summary = Vec::new();
        let mut offsets = Vec::new();
        let channels = self
            .channels
            .iter()
            .map(|channel| channel.record.as_slice());
        let groups = [
            (Kind::Schema, self.schemas.concat()),
            (Kind::Channel, channels.collect::<Vec<_>>().concat()),
            (Kind::ChunkIndex, self.chunk_indexes.concat()),
            (Kind::MetadataIndex, self.metadata_indexes.concat()),
            (Kind::Statistics, self.statistics()),
        ];
        for (kind, records) in groups
            .into_iter()
            .filter(|(_, records)| !records.is_empty())
        {
            let offset = Record::new(Kind::SummaryOffset)
                .u8(kind as u8)
                .u64(start + summary.len() as u64)
                .u64(records.len() as u64);
            offsets.extend(offset.done());
            summary.extend(records);
        }
        let offsets_start = start + summary.len() as u64;
        summary.extend(offsets);
        let footer = Record::new(Kind::Footer).u64(start).u64(offsets_start);
        let footer = footer.u32(0).done();
        // The checksum covers everything from the summary to itself.
        summary.extend(
            footer
                .split_last_chunk::<4>()
                .map_or(&footer[..], |(most, _)| most),
        );
        let checksum = crc32fast::hash(&summary);
        summary.extend(checksum.to_le_bytes());
        self.put(&summary)?;
        self.put(MAGIC)?;
        Ok(self.out)
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.place += bytes.len() as u64;
        self.out.write_all(bytes)
    }
}

fn compressed(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = FrameEncoder::new(Vec::with_capacity(bytes.len()));
    encoder.write_all(bytes)?;
    encoder.finish().map_err(io::Error::other)
}
