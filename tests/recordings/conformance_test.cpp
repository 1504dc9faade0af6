// The format's own conformance files: what a reader must find in each is in the .json beside it. They are in the folder
// that SIGHTLINE_MCAP_CONFORMANCE names, or beside the repository in shared/assets/mcap-conformance; without them the
// test is skipped.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "client/recordings/commands.h"
#include "server/record/mcap_reader.h"
#include "tests/record/small_file.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Fields = std::map<std::string, Json>;

constexpr size_t kPublishedFiles = 416;

fs::path folder() {
  if (const char* named = std::getenv("SIGHTLINE_MCAP_CONFORMANCE")) return named;
  return fs::path(SIGHTLINE_SOURCE_DIR) / "../shared/assets/mcap-conformance";
}

std::vector<fs::path> files() {
  std::vector<fs::path> found;
  if (!fs::is_directory(folder())) return found;
  for (const auto& entry : fs::recursive_directory_iterator(folder()))
    if (entry.path().extension() == ".mcap") found.push_back(entry.path());
  std::sort(found.begin(), found.end());
  return found;
}

uint64_t number(const Json& text) {
  return std::stoull(text.get<std::string>());
}
std::string bytes(const Json& list) {
  std::string out;
  for (const Json& byte : list) out.push_back(static_cast<char>(number(byte)));
  return out;
}

// The records of one kind that a reader must find.
std::vector<Fields> expected(const Json& told, const std::string& kind) {
  std::vector<Fields> found;
  for (const Json& record : told.at("records")) {
    if (record.at("type") != kind) continue;
    Fields& fields = found.emplace_back();
    for (const Json& field : record.at("fields")) fields[field[0].get<std::string>()] = field[1];
  }
  return found;
}

template <typename Visit>
void for_each_file(const Visit& visit) {
  for (const fs::path& path : files()) {
    SCOPED_TRACE(path.filename().string());
    visit(path, Json::parse(std::ifstream(fs::path(path).replace_extension(".json"))));
  }
}

class Conformance : public testing::Test {
 protected:
  void SetUp() override {
    if (files().empty()) GTEST_SKIP() << "the conformance files of the format are not in " << folder();
    ASSERT_EQ(files().size(), kPublishedFiles);
  }
};

TEST_F(Conformance, EveryFileIsReadAsItsDescriptionSays) {
  for_each_file([](const fs::path& path, const Json& told) {
    const auto source = open_file_source(path.string());
    ASSERT_TRUE(source.has_value());
    const auto reader = McapReader::open(**source, {});
    ASSERT_TRUE(reader.has_value());
    const McapInfo& info = reader->info();
    EXPECT_TRUE(info.loss.none());
    EXPECT_TRUE(info.finished);

    std::map<uint16_t, std::string> topics;
    for (Fields& fields : expected(told, "Channel")) {
      const auto id = static_cast<uint16_t>(number(fields["id"]));
      topics[id] = fields["topic"];
      ASSERT_TRUE(info.channels.contains(id));
      const mcap::Channel& channel = info.channels.at(id);
      EXPECT_EQ(channel.topic, fields["topic"]);
      EXPECT_EQ(channel.message_encoding, fields["message_encoding"]);
      EXPECT_EQ(channel.schema_id, number(fields["schema_id"]));
      EXPECT_EQ(channel.metadata, (fields["metadata"].get<std::map<std::string, std::string>>()));
    }
    EXPECT_EQ(info.channels.size(), topics.size());
    std::set<uint64_t> schemas;
    for (Fields& fields : expected(told, "Schema")) {
      schemas.insert(number(fields["id"]));
      const mcap::Schema& schema = info.schemas.at(static_cast<uint16_t>(number(fields["id"])));
      EXPECT_EQ(schema.name, fields["name"]);
      EXPECT_EQ(schema.encoding, fields["encoding"]);
      EXPECT_EQ(schema.data, bytes(fields["data"]));
    }
    EXPECT_EQ(info.schemas.size(), schemas.size());

    std::vector<test::PlainMessage> messages;
    for (Fields& fields : expected(told, "Message"))
      messages.push_back({topics.at(static_cast<uint16_t>(number(fields["channel_id"]))),
                          static_cast<uint32_t>(number(fields["sequence"])), number(fields["log_time"]),
                          number(fields["publish_time"]), bytes(fields["data"])});
    McapReadReport report;
    EXPECT_EQ(test::read_all(*reader, {}, &report), messages);
    EXPECT_TRUE(report.loss.none());
    EXPECT_EQ(info.statistics.message_count, messages.size());

    const std::vector<Fields> attachments = expected(told, "Attachment");
    ASSERT_EQ(info.attachments.size(), attachments.size());
    for (size_t i = 0; i < attachments.size(); ++i) {
      Fields fields = attachments[i];
      EXPECT_EQ(info.attachments[i].name, fields["name"]);
      EXPECT_EQ(info.attachments[i].content_type, fields["media_type"]);
      EXPECT_EQ(info.attachments[i].create_time_ns, number(fields["create_time"]));
      EXPECT_EQ(info.attachments[i].log_time_ns, number(fields["log_time"]));
      EXPECT_EQ(reader->attachment(info.attachments[i]).value(), bytes(fields["data"]));
    }
    const std::vector<Fields> metadata = expected(told, "Metadata");
    ASSERT_EQ(info.metadata.size(), metadata.size());
    for (size_t i = 0; i < metadata.size(); ++i) {
      Fields fields = metadata[i];
      const auto found = reader->metadata(info.metadata[i]);
      EXPECT_EQ(found->name, fields["name"]);
      EXPECT_EQ(found->values, (fields["metadata"].get<std::map<std::string, std::string>>()));
    }
  });
}

TEST_F(Conformance, EveryFileIsSoundAndSaysWhatItLeavesOut) {
  size_t sound = 0, without_something = 0;
  for_each_file([&](const fs::path& path, const Json& told) {
    std::ostringstream out, err;
    const int status = run_verify_command({.files = {path.string()}, .json = true}, out, err);
    EXPECT_EQ(status, 0) << out.str() << err.str();
    const Json verdict = Json::parse(out.str());
    EXPECT_EQ(verdict["lost"]["troubles"], 0);
    EXPECT_EQ(verdict["disagreements"]["troubles"], 0);
    sound += status == 0;
    without_something += !verdict["absent"].empty();
    size_t messages = 0;
    for (const Json& topic : verdict["topics"]) messages += topic["messages"].get<size_t>();
    EXPECT_EQ(messages, expected(told, "Message").size());
  });
  EXPECT_EQ(sound, kPublishedFiles);
  EXPECT_GT(without_something, 0u) << "some of the files leave out optional indexes";
}

TEST_F(Conformance, InfoAndDumpGoThroughEveryFile) {
  for_each_file([](const fs::path& path, const Json& told) {
    std::ostringstream out, err;
    EXPECT_EQ(run_info_command({.files = {path.string()}, .json = true}, out, err), 0) << err.str();
    const Json info = Json::parse(out.str());
    EXPECT_EQ(info["lost"]["troubles"], 0);
    EXPECT_EQ(info["attachments"].size(), expected(told, "Attachment").size());
    // The messages have an encoding of their own, so each line has an error in the place of the message, and the
    // command fails.
    std::ostringstream lines, dump_err;
    const int status = run_dump_command({.file = path.string()}, lines, dump_err);
    const std::string text = lines.str();
    const size_t messages = expected(told, "Message").size();
    EXPECT_EQ(static_cast<size_t>(std::count(text.begin(), text.end(), '\n')), messages);
    EXPECT_EQ(status, messages > 0 ? 1 : 0) << dump_err.str();
    EXPECT_EQ(dump_err.str().find("cannot be decoded") != std::string::npos, messages > 0) << dump_err.str();
  });
}

}  // namespace
}  // namespace sightline
