// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/ocr/run_program_internal.h"

namespace pagesweep {
namespace {

constexpr std::size_t most_output_bytes = std::size_t{1} << 30;

std::string message_of(int error) { return std::generic_category().message(error); }

/// What the child's stdin, stdout and stderr are.
class Redirection {
 public:
  Redirection(const std::filesystem::path& output, const std::filesystem::path& messages) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawn_file_actions_addopen(&actions_, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions_, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_addopen(&actions_, STDERR_FILENO, messages.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  }
  ~Redirection() { posix_spawn_file_actions_destroy(&actions_); }
  Redirection(const Redirection&) = delete;
  Redirection& operator=(const Redirection&) = delete;
  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_;
};

/// This process's environment with one OpenMP thread.
std::vector<char*> environment(std::string& limit) {
  std::vector<char*> variables;
  for (char** variable = environ; *variable; ++variable)
    if (!std::string_view(*variable).starts_with("OMP_THREAD_LIMIT=")) variables.push_back(*variable);
  variables.push_back(limit.data());
  variables.push_back(nullptr);
  return variables;
}

int wait_for(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return 1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "pagesweep-XXXXXX").string();
  if (!::mkdtemp(pattern.data())) throw cannot_write(pattern, message_of(errno));
  path_ = pattern;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::optional<ProgramOutput> run_program(const std::vector<std::string>& words) {
  const TemporaryFolder folder;
  const Redirection redirection(folder / "output", folder / "messages");
  std::string limit = "OMP_THREAD_LIMIT=1";
  const std::vector<char*> variables = environment(limit);
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  pid_t child = 0;
  const int error =
      ::posix_spawnp(&child, arguments[0], redirection.get(), nullptr, arguments.data(), variables.data());
  if (error == ENOENT) return std::nullopt;
  if (error != 0) throw Error(ErrorKind::cannot_read, fmt::format("{} cannot be run: {}", words[0], message_of(error)));
  ProgramOutput result;
  result.exit_code = wait_for(child);
  result.output = read_bytes(folder / "output", most_output_bytes);
  result.messages = read_bytes(folder / "messages", most_output_bytes);
  return result;
}

}  // namespace pagesweep
