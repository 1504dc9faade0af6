// A socket that listens: TCP, or a unix socket with its file.
#pragma once

#include <sys/stat.h>

#include <string>

#include "server/base/error.h"

namespace sightline {

// Closes a file descriptor at the end of its life. -1: none.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int fd) : fd_(fd) {}
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(other.release()) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept;
  ~FileDescriptor();

  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  int release() {
    const int fd = fd_;
    fd_ = -1;
    return fd;
  }

 private:
  int fd_ = -1;
};

// Not thread-safe.
class ListeningSocket {
 public:
  // `address` is host:port; port 0 takes a free one. The port is not shared with other processes. Fails with
  // kUnavailable or kInvalidArgument, field "--listen".
  static Result<ListeningSocket> tcp(const std::string& address);
  // Makes the socket file with `mode`. A file that no process serves any more is replaced; any other is left alone.
  // Fails with kUnavailable or kInvalidArgument, field "--listen-unix".
  static Result<ListeningSocket> unix_file(const std::string& path, unsigned mode);

  // What can be known of an address without taking it. `stays_on_host`: as below; it fails when the host is not known,
  // with field `flag`.
  static Result<bool> stays_on_host(const std::string& address, const std::string& flag);
  static Status check_unix_path(const std::string& path);

  ListeningSocket(ListeningSocket&&) noexcept = default;
  ListeningSocket& operator=(ListeningSocket&&) noexcept = default;
  // Removes the socket file, unless another process has put its own there since.
  ~ListeningSocket();

  int fd() const { return fd_.get(); }
  // For clients: "127.0.0.1:50151" or "unix:/run/sightline.sock".
  const std::string& address() const { return address_; }
  int port() const { return port_; }  // 0 for a unix socket
  // Only processes of this host can connect: a unix socket, or a loopback address.
  bool stays_on_host() const { return stays_on_host_; }

 private:
  ListeningSocket() = default;

  FileDescriptor fd_;
  std::string address_, path_;  // path_: of the socket file; empty for TCP
  dev_t device_ = 0;            // identify the file
  ino_t inode_ = 0;
  int port_ = 0;
  bool stays_on_host_ = true;
};

}  // namespace sightline
