// The small HTTP server for Prometheus and probes, by sockets that send what they like. Nobody's connection keeps a
// probe from its answer.
#include "server/metrics/http_port.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <atomic>
#include <future>
#include <list>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "server/metrics/http_request.h"

namespace sightline {
namespace {

constexpr size_t kLongBody = size_t{16} << 20;  // more than the buffers of both sockets hold

// A client of one connection. Its reads give up after a while, so that a test fails instead of hanging.
class Client {
 public:
  explicit Client(int port, const char* from = "127.0.0.1", int receive_bytes = 0)
      : fd_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const timeval patience{20, 0};
    ::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    if (receive_bytes > 0) ::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVBUF, &receive_bytes, sizeof(receive_bytes));
    const sockaddr_in own = address(from, 0), server = address("127.0.0.1", port);
    EXPECT_EQ(::bind(fd_.get(), reinterpret_cast<const sockaddr*>(&own), sizeof(own)), 0);
    EXPECT_EQ(::connect(fd_.get(), reinterpret_cast<const sockaddr*>(&server), sizeof(server)), 0);
  }

  void send(std::string_view text) const { ::send(fd_.get(), text.data(), text.size(), MSG_NOSIGNAL); }
  // Until the server closes its side. "reset": it did not close in order.
  std::string read_all() const {
    std::string all(1 << 16, '\0');
    size_t size = 0;
    for (;;) {
      const ssize_t more = ::recv(fd_.get(), all.data() + size, all.size() - size, 0);
      if (more < 0) return "reset";
      if (more == 0) break;
      size += static_cast<size_t>(more);
      if (size == all.size()) all.resize(2 * size);
    }
    all.resize(size);
    return all;
  }
  std::string ask(std::string_view request) const {
    send(request);
    return read_all();
  }

 private:
  static sockaddr_in address(const char* host, int port) {
    sockaddr_in made{};
    made.sin_family = AF_INET;
    made.sin_port = htons(static_cast<uint16_t>(port));
    ::inet_pton(AF_INET, host, &made.sin_addr);
    return made;
  }

  FileDescriptor fd_;
};

std::string get(std::string_view path) {
  return "GET " + std::string(path) + " HTTP/1.1\r\nHost: here\r\n\r\n";
}

int status_of(const std::string& answer) {
  return answer.starts_with("HTTP/1.1 ") ? std::stoi(answer.substr(9, 3)) : 0;
}

std::string body_of(const std::string& answer) {
  const size_t end = answer.find("\r\n\r\n");
  return end == std::string::npos ? "no body" : answer.substr(end + 4);
}

class HttpPortTest : public testing::Test {
 protected:
  // The page "/held" is made when the test lets it go.
  HttpPortTest() {
    HttpPort::Pages pages{{"/alive", {[] { return HttpAnswer{.body = "ok\n"}; }}},
                          {"/ill", {[] { return HttpAnswer{.status = 503, .body = "ill\n"}; }}},
                          {"/throws", {[]() -> HttpAnswer { throw std::runtime_error("no"); }}},
                          {"/long", {[] { return HttpAnswer{.body = std::string(kLongBody, 'x')}; }}},
                          {"/held",
                           {[this, go = go_.get_future().share()] {
                              if (++makings_ == 1) begun_.set_value();
                              go.wait();
                              return HttpAnswer{.body = "held\n"};
                            },
                            true}}};
    auto started = HttpPort::start("127.0.0.1:0", "--flag", std::move(pages));
    EXPECT_TRUE(started) << to_string(started.error());
    server_ = std::move(*started);
  }
  int port() const { return server_->port(); }
  Client client() const { return Client(port()); }
  void expect_alive() const { EXPECT_EQ(body_of(client().ask(get("/alive"))), "ok\n"); }

  std::promise<void> go_, begun_;
  std::atomic<int> makings_{0};
  std::unique_ptr<HttpPort> server_;
};

TEST_F(HttpPortTest, AnswersWithThePage) {
  const std::string answer = client().ask(get("/alive"));
  EXPECT_EQ(answer,
            "HTTP/1.1 200 OK\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: 3\r\nCache-Control: "
            "no-store\r\nConnection: close\r\n\r\nok\n");
  EXPECT_EQ(status_of(client().ask(get("/ill"))), 503);
  EXPECT_EQ(status_of(client().ask(get("/throws"))), 500);
}

TEST_F(HttpPortTest, AnswersHeadWithoutTheBody) {
  const std::string answer = client().ask("HEAD /alive HTTP/1.0\r\n\r\n");
  EXPECT_NE(answer.find("Content-Length: 3\r\n"), std::string::npos);
  EXPECT_EQ(body_of(answer), "");
}

TEST_F(HttpPortTest, RefusesEverythingElse) {
  const std::string unknown = client().ask(get("/other"));
  EXPECT_EQ(status_of(unknown), 404);
  EXPECT_NE(unknown.find("/alive\n"), std::string::npos) << "it says which pages there are";
  EXPECT_EQ(status_of(client().ask("POST /alive HTTP/1.1\r\nContent-Length: 3\r\n\r\nabc")), 405);
  EXPECT_EQ(status_of(client().ask("PRI * HTTP/2.0\r\n\r\n")), 400);
  EXPECT_EQ(status_of(client().ask("\r\n\r\n")), 400);
  EXPECT_EQ(status_of(client().ask("GET /alive\r\n\r\n")), 400);
}

TEST_F(HttpPortTest, EndsAHeadThatIsTooLong) {
  const Client one = client();
  one.send("GET /alive HTTP/1.1\r\nX: ");
  EXPECT_EQ(status_of(one.ask(std::string(HttpConnection::kMostHeadBytes, 'x'))), 431);
}

TEST_F(HttpPortTest, TakesARequestThatComesByteByByte) {
  const Client one = client();
  for (const char byte : get("/alive")) one.send({&byte, 1});
  EXPECT_EQ(body_of(one.read_all()), "ok\n");
}

TEST_F(HttpPortTest, AnswersTheFirstOfManyRequestsAndClosesInOrder) {
  std::string many;
  for (int i = 0; i < 1000; ++i) many += get("/alive");
  EXPECT_EQ(body_of(client().ask(many)), "ok\n");
}

TEST_F(HttpPortTest, ConnectionsThatAreSilentMakeWay) {
  std::list<Client> silent;
  for (size_t i = 0; i < 2 * HttpPort::kMostConnections; ++i) {
    silent.emplace_back(port());
    silent.back().send("GET /alive HTTP/1.1\r\n");
    if (i % 16 == 0) expect_alive();
  }
  expect_alive();
  const std::string oldest = silent.front().read_all();
  EXPECT_TRUE(oldest.empty() || oldest == "reset") << "the oldest has lost its place";
}

TEST_F(HttpPortTest, ConnectionsOfOneClientDoNotTakeThePlaceOfAnother) {
  const Client other(port(), "127.0.0.2");
  other.send("GET /alive ");
  std::list<Client> silent;
  for (size_t i = 0; i < 2 * HttpPort::kMostConnections; ++i) silent.emplace_back(port());
  expect_alive();
  EXPECT_EQ(body_of(other.ask("HTTP/1.1\r\n\r\n")), "ok\n");
}

TEST_F(HttpPortTest, ClientsThatDoNotReadDelayNobody) {
  std::list<Client> deaf;
  for (int i = 0; i < 8; ++i) deaf.emplace_back(port(), "127.0.0.1", 4096).send(get("/long"));
  expect_alive();
  EXPECT_EQ(body_of(client().ask(get("/long"))).size(), kLongBody);
}

TEST_F(HttpPortTest, APageThatTakesLongDelaysNoOther) {
  std::future<void> begun = begun_.get_future();
  const Client held = client();
  held.send(get("/held"));
  begun.wait();
  expect_alive();
  go_.set_value();
  EXPECT_EQ(body_of(held.read_all()), "held\n");
}

TEST_F(HttpPortTest, WhoAsksWhileAPageIsMadeSharesTheNext) {
  std::future<void> begun = begun_.get_future();
  const Client first = client();
  first.send(get("/held"));
  begun.wait();
  std::list<Client> later;
  for (int i = 0; i < 5; ++i) later.emplace_back(port()).send(get("/held"));
  const Client head = client();
  head.send("HEAD /held HTTP/1.1\r\n\r\n");
  expect_alive();  // all that came before has been read
  go_.set_value();
  EXPECT_EQ(body_of(first.read_all()), "held\n");
  for (const Client& one : later) EXPECT_EQ(body_of(one.read_all()), "held\n");
  EXPECT_EQ(body_of(head.read_all()), "");
  EXPECT_EQ(makings_, 2);
}

TEST_F(HttpPortTest, EndsWithConnectionsOfAllKinds) {
  const Client silent = client(), deaf(port(), "127.0.0.1", 4096);
  deaf.send(get("/long"));
  expect_alive();
  server_.reset();
  EXPECT_EQ(silent.read_all(), "") << "it is closed";
}

TEST_F(HttpPortTest, SaysWhichAddressCannotBeUsed) {
  const auto second = HttpPort::start("127.0.0.1:" + std::to_string(port()), "--flag", {});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(second.error().field, "--flag");
  const auto wrong = HttpPort::start("nonsense", "--flag", {});
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().code, ErrorCode::kInvalidArgument);
}

TEST(RequestHead, DoesNotDependOnHowTheBytesAreCut) {
  for (const std::string_view whole : {"GET /a?b=/c HTTP/1.1\r\nA: b\r\n\r\nrest",
                                       "GET http://host:1/a HTTP/1.0\nA: b\n\nrest", "GET /a HTTP/1.1\r\n\r\n"}) {
    for (size_t first = 1; first < whole.size(); ++first) {
      HttpRequest request;
      HeadState state = read_request_head(whole.substr(0, first), 0, request);
      const bool was_complete = state == HeadState::kComplete;
      if (!was_complete) state = read_request_head(whole, first, request);
      EXPECT_EQ(state, HeadState::kComplete) << whole << " cut at " << first;
      EXPECT_EQ(request.method, "GET");
      EXPECT_EQ(request.path, "/a");
      EXPECT_EQ(was_complete, whole.size() - first <= (whole.ends_with("rest") ? 4u : 0u))
          << whole << " cut at " << first;
    }
  }
}

TEST(RequestHead, TellsWrongOnes) {
  HttpRequest request;
  for (const std::string_view wrong : {"\r\n\r\n", "GET\r\n\r\n", "GET /\r\n\r\n", " / HTTP/1.1\r\n\r\n",
                                       "GET / HTTP/2.0\r\n\r\n", "GET / FTP/1.1\r\n\r\n"})
    EXPECT_EQ(read_request_head(wrong, 0, request), HeadState::kWrong) << wrong;
}

}  // namespace
}  // namespace sightline
