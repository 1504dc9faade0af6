//! Copies a recording with the format's own crate: copies IN.mcap OUT_FOLDER. Prints the name of each copy.
use mcap::read::{attachment, metadata};
use mcap::sans_io::{IndexedReadEvent, IndexedReader};
use mcap::{Compression, McapResult, Message, MessageStream, Summary, WriteOptions};
use std::{borrow::Cow, env, fs, io::BufWriter, path::Path};

struct Change {
    name: &'static str,
    sorted: bool,
    prefix: &'static str, // only the topics that begin so
    options: WriteOptions,
}

fn change(name: &'static str, options: WriteOptions) -> Change {
    Change { name, sorted: false, prefix: "", options }
}

fn changes() -> Vec<Change> {
    let packed = |compression| WriteOptions::new().compression(compression);
    vec![
        Change { sorted: true, ..change("sorted", packed(Some(Compression::Zstd))) },
        Change { prefix: "/sightline/", ..change("filtered", packed(Some(Compression::Zstd))) },
        change("zstd", packed(Some(Compression::Zstd))),
        change("lz4", packed(Some(Compression::Lz4))),
        change("none", packed(None)),
        change("unchunked", WriteOptions::new().use_chunks(false)),
        change("unindexed", WriteOptions::new().emit_message_indexes(false).emit_summary_records(false).emit_summary_offsets(false)),
    ]
}

/// The messages in the order of their log times.
fn sorted<'a>(bytes: &'a [u8], summary: &Summary) -> McapResult<Vec<Message<'a>>> {
    let channels: Vec<_> = MessageStream::new(bytes)?.collect::<McapResult<Vec<_>>>()?.into_iter().map(|m| m.channel).collect();
    let mut reader = IndexedReader::new(summary)?;
    let mut messages = Vec::new();
    while let Some(event) = reader.next_event() {
        match event? {
            IndexedReadEvent::ReadChunkRequest { offset, length } => {
                reader.insert_chunk_record_data(offset, &bytes[offset as usize..][..length])?
            }
            IndexedReadEvent::Message { header, data } => messages.push(Message {
                channel: channels.iter().find(|channel| channel.id == header.channel_id).expect("a message has a channel").clone(),
                sequence: header.sequence,
                log_time: header.log_time,
                publish_time: header.publish_time,
                data: Cow::Owned(data.to_vec()),
            }),
        }
    }
    Ok(messages)
}

fn copy(bytes: &[u8], summary: &Summary, change: &Change, path: &Path) -> McapResult<()> {
    let mut writer = change.options.clone().create(BufWriter::new(fs::File::create(path)?))?;
    let messages = if change.sorted { sorted(bytes, summary)? } else { MessageStream::new(bytes)?.collect::<McapResult<_>>()? };
    for message in messages.iter().filter(|message| message.channel.topic.starts_with(change.prefix)) {
        writer.write(message)?;
    }
    for index in &summary.attachment_indexes {
        writer.attach(&attachment(bytes, index)?)?;
    }
    for index in &summary.metadata_indexes {
        writer.write_metadata(&metadata(bytes, index)?)?;
    }
    writer.finish()?;
    Ok(())
}

fn main() -> McapResult<()> {
    let words: Vec<String> = env::args().collect();
    let bytes = fs::read(&words[1])?;
    let summary = Summary::read(&bytes)?.expect("the recording has a summary");
    for change in changes() {
        copy(&bytes, &summary, &change, &Path::new(&words[2]).join(format!("{}.mcap", change.name)))?;
        println!("{}", change.name);
    }
    Ok(())
}
