// RPC ListSessions over real gRPC: pages, and sessions that open and end between two of them.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <deque>
#include <string>
#include <vector>

#include "tests/service/service_world.h"

namespace sightline {
namespace {

using testing::ElementsAre;

class ListSessions : public testing::Test {
 protected:
  Stream& open(const char* label) {
    v1::OpenSession request = open_with_boxes(2);
    request.set_label(label);
    streams_.emplace_back(channel_).open(request);
    return streams_.back();
  }
  // Asks for the page of `request_`, and goes on to the next.
  std::vector<std::string> next_page() {
    v1::ListSessionsResponse response;
    const grpc::Status status = ask(request_, response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    request_.set_page_token(response.next_page_token());
    std::vector<std::string> labels;
    for (const v1::SessionFigures& session : response.sessions()) labels.push_back(session.label());
    return labels;
  }
  grpc::Status ask(const v1::ListSessionsRequest& request, v1::ListSessionsResponse& response) {
    grpc::ClientContext context;
    return v1::CameraControlService::NewStub(channel_)->ListSessions(&context, request, &response);
  }
  std::vector<std::string> refused_fields(const v1::ListSessionsRequest& request) {
    v1::ListSessionsResponse response;
    const grpc::Status status = ask(request, response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    return fields_of(status);
  }

  ServiceWorld world_;
  std::shared_ptr<grpc::Channel> channel_ = world_.channel();
  std::deque<Stream> streams_;
  v1::ListSessionsRequest request_;
};

TEST_F(ListSessions, ComesInPages) {
  EXPECT_THAT(next_page(), ElementsAre());
  for (const char* label : {"a", "b", "c", "d", "e"}) open(label);
  EXPECT_THAT(next_page(), ElementsAre("a", "b", "c", "d", "e"));
  EXPECT_EQ(request_.page_token(), "");
  request_.set_page_size(2);
  EXPECT_THAT(next_page(), ElementsAre("a", "b"));
  EXPECT_THAT(next_page(), ElementsAre("c", "d"));
  EXPECT_THAT(next_page(), ElementsAre("e"));
  EXPECT_EQ(request_.page_token(), "");
  request_.set_page_size(5);
  EXPECT_THAT(next_page(), ElementsAre("a", "b", "c", "d", "e"));
  EXPECT_EQ(request_.page_token(), "") << "a full page is the last one when nothing follows";
}

TEST_F(ListSessions, WhatOpensAndEndsBetweenTwoPagesChangesNoOtherRow) {
  open("a");
  Stream& b = open("b");
  open("c");
  request_.set_page_size(2);
  EXPECT_THAT(next_page(), ElementsAre("a", "b"));
  b.half_close();
  EXPECT_TRUE(b.finish().ok());
  open("d");
  EXPECT_THAT(next_page(), ElementsAre("c", "d"));
  EXPECT_EQ(request_.page_token(), "");
}

TEST_F(ListSessions, OtherSizesAndTokensAreRefusedByName) {
  open("a"), open("b");
  v1::ListSessionsRequest request;
  request.set_page_size(1001);
  EXPECT_THAT(refused_fields(request), ElementsAre("page_size"));
  request.set_page_size(1);
  v1::ListSessionsResponse response;
  ASSERT_TRUE(ask(request, response).ok());
  const std::string token = response.next_page_token();
  std::vector<std::string> wrong_tokens{"1", "x", "-", "/", "/1", "another-daemon/1"};
  for (size_t length = 1; length < token.size(); ++length) wrong_tokens.push_back(token.substr(0, length));
  for (const char* more : {" ", "x", "99999999999999999999", "/1"}) wrong_tokens.push_back(token + more);
  for (const std::string& wrong : wrong_tokens) {
    request.set_page_token(wrong);
    EXPECT_THAT(refused_fields(request), ElementsAre("page_token")) << wrong;
  }
  request.set_page_token(token);
  EXPECT_TRUE(ask(request, response).ok());
}

}  // namespace
}  // namespace sightline
