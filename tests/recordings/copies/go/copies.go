// Command copies uses the format's own Go library:
//
//	copies IN.mcap OUT_FOLDER    copies a recording in several ways and prints the name of each copy
//	copies examine IN.mcap       fails where `mcap doctor --strict-message-order` would warn
package main

import (
	"errors"
	"fmt"
	"io"
	"log"
	"os"
	"path/filepath"
	"strings"

	"github.com/foxglove/mcap/go/mcap"
)

type change struct {
	name    string
	sorted  bool
	prefix  string // only the topics that begin so
	options mcap.WriterOptions
}

func packed(compression mcap.CompressionFormat) mcap.WriterOptions {
	return mcap.WriterOptions{IncludeCRC: true, Chunked: true, ChunkSize: 1 << 20, Compression: compression}
}

var changes = []change{
	{name: "sorted", sorted: true, options: packed(mcap.CompressionZSTD)},
	{name: "filtered", prefix: "/sightline/", options: packed(mcap.CompressionZSTD)},
	{name: "zstd", options: packed(mcap.CompressionZSTD)},
	{name: "lz4", options: packed(mcap.CompressionLZ4)},
	{name: "none", options: packed(mcap.CompressionNone)},
	{name: "unchunked", options: mcap.WriterOptions{IncludeCRC: true}},
	{name: "unindexed", options: mcap.WriterOptions{Chunked: true, ChunkSize: 1 << 20, Compression: mcap.CompressionZSTD, SkipMessageIndexing: true,
		SkipStatistics: true, SkipRepeatedSchemas: true, SkipRepeatedChannelInfos: true, SkipAttachmentIndex: true, SkipMetadataIndex: true,
		SkipChunkIndex: true, SkipSummaryOffsets: true}},
}

// copier writes what it reads, and each schema and channel once.
type copier struct {
	writer   *mcap.Writer
	prefix   string
	channels map[uint16]bool
}

func (c *copier) message(schema *mcap.Schema, channel *mcap.Channel, message *mcap.Message) error {
	if !strings.HasPrefix(channel.Topic, c.prefix) {
		return nil
	}
	if !c.channels[channel.ID] {
		c.channels[channel.ID] = true
		if err := errors.Join(c.writer.WriteSchema(schema), c.writer.WriteChannel(channel)); err != nil {
			return err
		}
	}
	return c.writer.WriteMessage(message)
}

func (c *copier) messages(in io.ReadSeeker, order mcap.ReadOpt) error {
	reader, err := mcap.NewReader(in)
	if err != nil {
		return err
	}
	defer reader.Close()
	found, err := reader.Messages(order)
	if err != nil {
		return err
	}
	return mcap.Range(found, c.message)
}

// rest copies the attachments and the metadata.
func (c *copier) rest(in io.ReadSeeker) error {
	reader, err := mcap.NewReader(in)
	if err != nil {
		return err
	}
	defer reader.Close()
	info, err := reader.Info()
	if err != nil {
		return err
	}
	for _, index := range info.AttachmentIndexes {
		from, err := reader.GetAttachmentReader(index.Offset)
		if err != nil {
			return err
		}
		if err := c.writer.WriteAttachment(&mcap.Attachment{LogTime: from.LogTime, CreateTime: from.CreateTime, Name: from.Name,
			MediaType: from.MediaType, DataSize: from.DataSize, Data: from.Data()}); err != nil {
			return err
		}
	}
	for _, index := range info.MetadataIndexes {
		metadata, err := reader.GetMetadata(index.Offset)
		if err != nil {
			return err
		}
		if err := c.writer.WriteMetadata(metadata); err != nil {
			return err
		}
	}
	return nil
}

func copyTo(path, input string, change change) error {
	in, err := os.Open(input)
	if err != nil {
		return err
	}
	defer in.Close()
	out, err := os.Create(path)
	if err != nil {
		return err
	}
	defer out.Close()
	writer, err := mcap.NewWriter(out, &change.options)
	if err != nil {
		return err
	}
	c := &copier{writer: writer, prefix: change.prefix, channels: map[uint16]bool{}}
	order := mcap.InOrder(mcap.FileOrder)
	if change.sorted {
		order = mcap.InOrder(mcap.LogTimeOrder)
	}
	if err := errors.Join(writer.WriteHeader(&mcap.Header{}), c.messages(in, order)); err != nil {
		return err
	}
	if _, err := in.Seek(0, io.SeekStart); err != nil {
		return err
	}
	return errors.Join(c.rest(in), writer.Close())
}

// seen holds what stood in the data so far.
type seen struct {
	records map[string]bool
	latest  uint64
}

// once refuses a schema or channel that stood in the data before.
func (s *seen) once(kind string, id uint16) error {
	name := fmt.Sprintf("%s %d", kind, id)
	if s.records[name] {
		return fmt.Errorf("%s stands twice in the data", name)
	}
	s.records[name] = true
	return nil
}

// later refuses a message that is earlier than one before it.
func (s *seen) later(message *mcap.Message) error {
	if message.LogTime < s.latest {
		return fmt.Errorf("message %d of channel %d is earlier than one before it", message.Sequence, message.ChannelID)
	}
	s.latest = message.LogTime
	return nil
}

func (s *seen) take(token mcap.TokenType, record []byte) error {
	switch token {
	case mcap.TokenSchema:
		schema, err := mcap.ParseSchema(record)
		if err != nil {
			return err
		}
		return s.once("schema", schema.ID)
	case mcap.TokenChannel:
		channel, err := mcap.ParseChannel(record)
		if err != nil {
			return err
		}
		return s.once("channel", channel.ID)
	case mcap.TokenMessage:
		message, err := mcap.ParseMessage(record)
		if err != nil {
			return err
		}
		return s.later(message)
	}
	return nil
}

func examine(path string) error {
	in, err := os.Open(path)
	if err != nil {
		return err
	}
	defer in.Close()
	lexer, err := mcap.NewLexer(in, &mcap.LexerOptions{ValidateChunkCRCs: true})
	if err != nil {
		return err
	}
	defer lexer.Close()
	s := &seen{records: map[string]bool{}}
	for {
		token, record, err := lexer.Next(nil)
		if err != nil || token == mcap.TokenDataEnd {
			return err
		}
		if err := s.take(token, record); err != nil {
			return err
		}
	}
}

func main() {
	log.SetFlags(0)
	if os.Args[1] == "examine" {
		if err := examine(os.Args[2]); err != nil {
			log.Fatal(err)
		}
		return
	}
	input, folder := os.Args[1], os.Args[2]
	for _, change := range changes {
		if err := copyTo(filepath.Join(folder, change.name+".mcap"), input, change); err != nil {
			log.Fatalf("%s: %v", change.name, err)
		}
		fmt.Println(change.name)
	}
}
