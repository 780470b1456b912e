// SPDX-License-Identifier: Apache-2.0
#include "ranks/process_group.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <mutex>
#include <new>
#include <stop_token>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <system_error>
#include <thread>
#include <unistd.h>

#include "ranks/rank_group.h"

namespace af {

namespace {

/// Longer messages go in pieces.
constexpr std::size_t kMailboxBytes = std::size_t{4} << 20;

enum class Asking : int { Nothing, Waits, Answered };

/// What all processes see of one of them.
struct RankBoard {
  std::atomic<Asking> asking = Asking::Nothing;
  RankGroup::Request request;
  RankGroup::Grant grant;
  std::uint64_t bytes = 0;  ///< that it sends
};

constexpr int kNotAborted = -1;

struct Board {
  std::atomic<std::uint32_t> arrived = 0;  ///< at a barrier
  std::atomic<std::uint32_t> barriers = 0;
  std::atomic<int> abort_code = kNotAborted;
  std::array<RankBoard, kMostProcesses> ranks;
  std::array<std::byte, kMailboxBytes> mailbox;
};
static_assert(std::atomic<Asking>::is_always_lock_free, "shared between processes");
static_assert(std::atomic<std::uint32_t>::is_always_lock_free, "shared between processes");

/// Processors are shared with ranks that compute, so waiting ranks sleep, at first briefly.
template <typename Condition>
void wait_until(Condition&& is_met) {
  constexpr std::chrono::microseconds kLongest{500};
  for (std::chrono::microseconds pause{5}; !is_met(); pause = std::min(2 * pause, kLongest))
    std::this_thread::sleep_for(pause);
}

/// The other processes, on rank 0 alone; 0 where there is none.
std::array<std::atomic<pid_t>, kMostProcesses> processes{};

void kill_others(int signal) noexcept {
  for (const std::atomic<pid_t>& process : processes)
    if (const pid_t id = process; id > 0) ::kill(id, signal);
}

class SharingProcesses : public RankGroup {
 public:
  SharingProcesses(Board& board, int rank, int size) : board_(board), rank_(rank), size_(size) {}

  void barrier() override {
    const std::uint32_t before = board_.barriers;
    if (board_.arrived.fetch_add(1) + 1 == static_cast<std::uint32_t>(size_)) {
      board_.arrived = 0;
      ++board_.barriers;
    } else {
      wait_until([&] { return board_.barriers != before; });
    }
  }

  void reduce(std::span<std::uint64_t> values, Reduction reduction) override {
    const std::size_t piece =
        kMailboxBytes / sizeof(std::uint64_t) / static_cast<std::size_t>(size_);
    while (!values.empty()) {
      reduce_piece(values.first(std::min(piece, values.size())), reduction);
      values = values.subspan(std::min(piece, values.size()));
    }
  }

  void broadcast(std::span<std::byte> bytes) override { send(0, bytes, bytes); }

  std::vector<std::vector<std::byte>> all_gather(std::span<const std::byte> mine) override {
    board_.ranks[static_cast<std::size_t>(rank_)].bytes = mine.size();
    barrier();
    std::vector<std::vector<std::byte>> parts(static_cast<std::size_t>(size_));
    for (std::size_t i = 0; i < parts.size(); ++i) parts[i].resize(board_.ranks[i].bytes);
    barrier();  // now they may be overwritten
    for (int sender = 0; sender < size_; ++sender)
      send(sender, mine, parts[static_cast<std::size_t>(sender)]);
    std::ranges::copy(mine, parts[static_cast<std::size_t>(rank_)].begin());
    return parts;
  }

  std::shared_ptr<RankGroup> node() override { return nullptr; }
  void broadcast_to_nodes(std::span<std::byte> /*bytes*/) override {}

  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return size_; }

  bool answer_request(const std::function<Grant(const Request&)>& answer) override {
    for (int rank = 1; rank < size_; ++rank) {
      RankBoard& board = board_.ranks[static_cast<std::size_t>(rank)];
      if (board.asking != Asking::Waits) continue;
      board.grant = answer(board.request);
      board.asking = Asking::Answered;
      return true;
    }
    return false;
  }

  Grant ask(const Request& request) override {
    RankBoard& board = board_.ranks[static_cast<std::size_t>(rank_)];
    board.request = request;
    board.asking = Asking::Waits;
    wait_until([&] { return board.asking == Asking::Answered; });
    board.asking = Asking::Nothing;
    return board.grant;
  }

  [[noreturn]] void abort(int exit_code) override {
    board_.abort_code = exit_code;  // rank 0's Watch sees it
    if (rank_ == 0)
      kill_others(SIGKILL);
    else
      ::kill(::getppid(), SIGCONT);  // it may be what the job is ended for: stopped
    std::_Exit(exit_code);
  }

 private:
  /// Collective. Copies `from` of the sender into `to` of every other rank, which has as many
  /// bytes.
  void send(int sender, std::span<const std::byte> from, std::span<std::byte> to) {
    for (std::size_t first = 0; first < to.size(); first += kMailboxBytes) {
      const std::size_t count = std::min(kMailboxBytes, to.size() - first);
      if (rank_ == sender) std::memcpy(board_.mailbox.data(), from.data() + first, count);
      barrier();
      if (rank_ != sender) std::memcpy(to.data() + first, board_.mailbox.data(), count);
      barrier();
    }
  }

  void reduce_piece(std::span<std::uint64_t> values, Reduction reduction) {
    const auto place = [&](int rank) {
      return board_.mailbox.data() + static_cast<std::size_t>(rank) * values.size_bytes();
    };
    std::memcpy(place(rank_), values.data(), values.size_bytes());
    barrier();
    std::vector<std::uint64_t> other(values.size());
    for (int rank = 0; rank < size_; ++rank) {
      if (rank == rank_) continue;
      std::memcpy(other.data(), place(rank), values.size_bytes());
      for (std::size_t i = 0; i < values.size(); ++i)
        values[i] =
            reduction == Reduction::Sum ? values[i] + other[i] : std::max(values[i], other[i]);
    }
    barrier();
  }

  Board& board_;
  int rank_;
  int size_;
};

/// Zeros that all copies of this process share.
Board& shared_board() {
  void* const memory =
      ::mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED)
    throw std::system_error(errno, std::generic_category(), "memory that processes share");
  return *new (memory) Board;
}

}  // namespace

/// Ends the job when a process is lost: one that aborted, or that was killed.
class ProcessGroup::Watch {
 public:
  Watch(Board& board, int size, std::function<void(const std::string&)> on_loss)
      : board_(board), size_(size), on_loss_(std::move(on_loss)) {
    thread_ = std::jthread([this](const std::stop_token& is_over) { watch(is_over); });
  }

  ~Watch() {
    for (int rank = 1; rank < size_; ++rank) look_at(rank, 0);
    thread_.request_stop();
    thread_.join();
    for (int rank = 1; rank < size_; ++rank)
      ::waitpid(processes[static_cast<std::size_t>(rank)].exchange(0), nullptr, 0);
  }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

 private:
  void watch(const std::stop_token& is_over) {
    constexpr std::chrono::milliseconds kTick{20};
    std::mutex own;
    std::unique_lock lock(own);
    std::condition_variable_any ended;
    while (!ended.wait_for(lock, is_over, kTick, [&] { return is_over.stop_requested(); }))
      for (int rank = 1; rank < size_; ++rank) look_at(rank, WNOHANG);
  }

  /// `flags`: WNOHANG, or 0 to wait for its end. The process remains to be waited for.
  void look_at(int rank, int flags) {
    const pid_t process = processes[static_cast<std::size_t>(rank)];
    siginfo_t found{};
    while (::waitid(P_PID, static_cast<id_t>(process), &found, WEXITED | WNOWAIT | flags) != 0)
      if (errno != EINTR) return;
    const int abort_code = board_.abort_code;
    if (abort_code == kNotAborted && (found.si_pid == 0 || found.si_code == CLD_EXITED)) return;
    // The destructor looks as well. What the first loss ends is no loss of its own.
    if (is_lost_.exchange(true)) return;
    kill_others(SIGKILL);
    if (abort_code != kNotAborted) std::_Exit(abort_code);
    on_loss_("rank " + std::to_string(rank) + " (process " + std::to_string(process) +
             ") was ended by signal " + std::to_string(found.si_status) + " (" +
             ::strsignal(found.si_status) + ")");
  }

  Board& board_;
  int size_;
  std::function<void(const std::string&)> on_loss_;
  std::atomic<bool> is_lost_ = false;
  std::jthread thread_;
};

ProcessGroup::ProcessGroup(int count, std::function<void(const std::string& text)> on_loss) {
  if (count <= 1) return;
  Board& board = shared_board();
  // A parent may have had it ignored. Then nobody learns how a process ended.
  std::signal(SIGCHLD, SIG_DFL);
  std::fflush(nullptr);
  std::cout.flush();
  const pid_t first = ::getpid();
  int rank = 0;
  for (int other = 1; other < count; ++other) {
    const pid_t process = ::fork();
    if (process < 0) {
      const int reason = errno;
      kill_others(SIGKILL);
      throw std::system_error(reason, std::generic_category(), "fork");
    }
    if (process == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (::getppid() != first) std::_Exit(1);  // it has ended already
      for (std::atomic<pid_t>& sibling : processes) sibling = 0;
      rank = other;
      break;
    }
    processes[static_cast<std::size_t>(other)] = process;
  }
  ranks_of_job() = std::make_shared<SharingProcesses>(board, rank, count);
  if (rank == 0) watch_ = std::make_unique<Watch>(board, count, std::move(on_loss));
}

ProcessGroup::~ProcessGroup() {
  watch_.reset();
  ranks_of_job() = nullptr;
}

void pass_on_signal(int signal) noexcept {
  kill_others(signal);
}

void LocalProcesses::describe(Fields& field) {
  field("processes",
        count,
        "Processes on this machine that share the work, without mpirun; results do not depend on "
        "them")
      .within(1, kMostProcesses)
      .checked_when_typed()
      .not_recorded("results are the same");
}

LocalProcesses& local_processes() {
  static LocalProcesses processes_of_program;
  return processes_of_program;
}

}  // namespace af
