// Copies a recording with the format's own Go library: copies IN.mcap OUT_FOLDER. Prints the name of each copy.
package main

import (
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
	order   mcap.ReadOrder
	prefix  string // only the topics that begin so
	options mcap.WriterOptions
}

func chunked(compression mcap.CompressionFormat) mcap.WriterOptions {
	return mcap.WriterOptions{Chunked: true, ChunkSize: 64 << 10, Compression: compression, IncludeCRC: true}
}

var changes = []change{
	{name: "sorted", order: mcap.LogTimeOrder, options: chunked(mcap.CompressionZSTD)},
	{name: "filtered", prefix: "/sightline/", options: chunked(mcap.CompressionZSTD)},
	{name: "zstd", options: chunked(mcap.CompressionZSTD)},
	{name: "lz4", options: chunked(mcap.CompressionLZ4)},
	{name: "none", options: chunked(mcap.CompressionNone)},
	{name: "unchunked", options: mcap.WriterOptions{}},
	{name: "unindexed", options: mcap.WriterOptions{Chunked: true, ChunkSize: 64 << 10, SkipMessageIndexing: true,
		SkipStatistics: true, SkipAttachmentIndex: true, SkipMetadataIndex: true, SkipChunkIndex: true, SkipSummaryOffsets: true,
		SkipRepeatedSchemas: true, SkipRepeatedChannelInfos: true}},
}

func must(err error) {
	if err != nil {
		log.Fatal(err)
	}
}

func copyMessages(reader *mcap.Reader, writer *mcap.Writer, c change) {
	messages, err := reader.Messages(mcap.InOrder(c.order))
	must(err)
	schemas, channels := map[uint16]bool{}, map[uint16]bool{}
	must(mcap.Range(messages, func(schema *mcap.Schema, channel *mcap.Channel, message *mcap.Message) error {
		if !strings.HasPrefix(channel.Topic, c.prefix) {
			return nil
		}
		if !schemas[schema.ID] {
			schemas[schema.ID] = true
			must(writer.WriteSchema(schema))
		}
		if !channels[channel.ID] {
			channels[channel.ID] = true
			must(writer.WriteChannel(channel))
		}
		return writer.WriteMessage(message)
	}))
}

func copyRest(reader *mcap.Reader, writer *mcap.Writer) {
	info, err := reader.Info()
	must(err)
	for _, index := range info.AttachmentIndexes {
		attachment, err := reader.GetAttachmentReader(index.Offset)
		must(err)
		must(writer.WriteAttachment(&mcap.Attachment{LogTime: attachment.LogTime, CreateTime: attachment.CreateTime,
			Name: attachment.Name, MediaType: attachment.MediaType, DataSize: attachment.DataSize, Data: attachment.Data()}))
	}
	for _, index := range info.MetadataIndexes {
		metadata, err := reader.GetMetadata(index.Offset)
		must(err)
		must(writer.WriteMetadata(metadata))
	}
}

func write(in io.Reader, out io.Writer, c change) {
	reader, err := mcap.NewReader(in)
	must(err)
	defer reader.Close()
	writer, err := mcap.NewWriter(out, &c.options)
	must(err)
	must(writer.WriteHeader(reader.Header()))
	copyMessages(reader, writer, c)
	copyRest(reader, writer)
	must(writer.Close())
}

func main() {
	for _, c := range changes {
		in, err := os.Open(os.Args[1])
		must(err)
		out, err := os.Create(filepath.Join(os.Args[2], c.name+".mcap"))
		must(err)
		write(in, out, c)
		must(out.Close())
		must(in.Close())
		fmt.Println(c.name)
	}
}
