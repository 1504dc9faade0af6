#include "tests/record/small_file.h"

#include <gtest/gtest.h>

namespace sightline::test {

SmallFile make_small_file(McapWriterOptions options, bool finish) {
  SmallFile file;
  file.attachment = std::string(700, '\0');
  for (size_t i = 0; i < file.attachment.size(); ++i) file.attachment[i] = static_cast<char>(i * i % 251);

  MemorySink sink;
  McapWriter writer(sink, std::move(options));
  const uint16_t schema = writer.add_schema("a.Schema", "protobuf", "not looked into").value();
  const uint16_t ticks = writer.add_channel("/tick", schema, "protobuf", {{"frame", "client"}}).value();
  const uint16_t replies = writer.add_channel("/reply", 0, "x-plain", {}).value();
  EXPECT_TRUE(writer.add_metadata({"about", {{"seed", "7"}, {"build", "test"}}}));
  for (uint32_t i = 0; i < 40; ++i) {
    const bool tick = i % 2 == 0;
    const uint64_t time_ns = 100 * kSecondNs + i * kSecondNs / 10;
    std::string data = (tick ? "tick " : "the reply ");
    data.append(std::to_string(i)).append(i % 7 * 5, static_cast<char>('a' + i % 26));
    EXPECT_TRUE(writer.write(tick ? ticks : replies, time_ns, time_ns - 5, data));
    file.messages.push_back({tick ? "/tick" : "/reply", i / 2 + 1, time_ns, time_ns - 5, std::move(data)});
    if (i == 15) {
      EXPECT_TRUE(writer.attach({time_ns, 1, "scene.glb", "model/gltf-binary", file.attachment, 0}));
    }
  }
  EXPECT_TRUE(finish ? writer.finish() : writer.end_chunk());
  file.bytes = sink.bytes();
  return file;
}

std::vector<PlainMessage> read_all(const McapReader& reader, const McapQuery& query, McapReadReport* report) {
  std::vector<PlainMessage> messages;
  const McapReadReport done = reader.read(query, [&](const McapMessage& m) {
    messages.push_back({m.channel.topic, m.message.sequence, m.message.log_time_ns, m.message.publish_time_ns,
                        std::string(m.message.data)});
    return true;
  });
  EXPECT_EQ(done.messages, messages.size());
  if (report != nullptr) *report = done;
  return messages;
}

}  // namespace sightline::test
