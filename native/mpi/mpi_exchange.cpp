#include "mpi/mpi_exchange.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <thread>

#include "base/error.h"

namespace stipple {

namespace {

/// Numbers in a message. Buffers hold a few of these, whatever the sizes of networks.
constexpr size_t kChunk = size_t{1} << 20;
constexpr size_t kLongestText = 1024;
constexpr int kWordTag = 1;
/// A message of a chunk takes less; what lasts longer is the work of another process, and the
/// processor is left to that.
constexpr auto kHotWait = std::chrono::milliseconds(1);
constexpr auto kPause = std::chrono::microseconds(200);

}  // namespace

MpiExchange::MpiExchange(const Progress& progress) : progress_(progress) {
  MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
  int rank = 0, size = 0;
  check(MPI_Comm_rank(MPI_COMM_WORLD, &rank), "beginning");
  check(MPI_Comm_size(MPI_COMM_WORLD, &size), "beginning");
  rank_ = static_cast<size_t>(rank);
  size_ = static_cast<size_t>(size);
  check(MPI_Comm_dup(MPI_COMM_WORLD, &numbers_), "beginning");
  check(MPI_Comm_dup(MPI_COMM_WORLD, &words_), "beginning");
  heard_.resize(kLongestText);
  if (rank_ != 0) return;
  check(MPI_Irecv(heard_.data(), static_cast<int>(heard_.size()), MPI_CHAR, MPI_ANY_SOURCE,
                  kWordTag, words_, &hearing_),
        "beginning");
}

void MpiExchange::check(int code, const char* doing) const {
  if (code == MPI_SUCCESS) return;
  char text[MPI_MAX_ERROR_STRING] = {};
  int length = 0;
  MPI_Error_string(code, text, &length);
  fail(ErrorCode::kUnavailable, "process " + std::to_string(rank_) + " of " +
                                    std::to_string(size_) + " has lost the others while " + doing +
                                    ": " + text);
}

/// Of rank 0: whether another process cannot go on.
void MpiExchange::listen() {
  if (hearing_ == MPI_REQUEST_NULL) return;
  int is_heard = 0;
  MPI_Status status = {};
  check(MPI_Test(&hearing_, &is_heard, &status), "listening to them");
  if (is_heard == 0) return;
  heard_.back() = '\0';
  fail(ErrorCode::kUnavailable, "process " + std::to_string(status.MPI_SOURCE) + " of " +
                                    std::to_string(size_) + " cannot go on: " + heard_.data());
}

void MpiExchange::wait(MPI_Request request, const char* doing) {
  const auto start = std::chrono::steady_clock::now();
  for (;;) {
    int is_done = 0;
    check(MPI_Test(&request, &is_done, MPI_STATUS_IGNORE), doing);
    if (is_done != 0) return;
    progress_.throwIfCancelled();
    listen();
    if (std::chrono::steady_clock::now() - start < kHotWait) {
      std::this_thread::yield();
    } else {
      std::this_thread::sleep_for(kPause);
    }
  }
}

/// Slice r of each chunk goes to rank r, which sums what all have of it: every sum is made once and
/// in the order of ranks, by whatever way messages travel. MPI_Allreduce promises neither.
template <class T>
void MpiExchange::sumInSlices(std::span<T> numbers, MPI_Datatype type, Buffers<T>& buffers) {
  for (size_t first = 0; first < numbers.size(); first += kChunk) {
    const std::span<T> chunk = numbers.subspan(first, std::min(kChunk, numbers.size() - first));
    const size_t slice = (chunk.size() + size_ - 1) / size_;
    buffers.out.assign(slice * size_, T{0});
    buffers.in.resize(slice * size_);
    buffers.slice.resize(slice);
    std::copy(chunk.begin(), chunk.end(), buffers.out.begin());
    const auto count = static_cast<int>(slice);
    MPI_Request request = MPI_REQUEST_NULL;
    check(MPI_Ialltoall(buffers.out.data(), count, type, buffers.in.data(), count, type, numbers_,
                        &request),
          "adding up");
    wait(request, "adding up");
    for (size_t i = 0; i < slice; ++i) {
      auto sum = static_cast<double>(buffers.in[i]);
      for (size_t rank = 1; rank < size_; ++rank) {
        sum += static_cast<double>(buffers.in[rank * slice + i]);
      }
      buffers.slice[i] = static_cast<T>(sum);
    }
    check(MPI_Iallgather(buffers.slice.data(), count, type, buffers.in.data(), count, type,
                         numbers_, &request),
          "adding up");
    wait(request, "adding up");
    std::copy_n(buffers.in.begin(), chunk.size(), chunk.begin());
  }
}

void MpiExchange::sum(std::span<float> numbers) {
  if (size_ > 1) sumInSlices(numbers, MPI_FLOAT, floats_);
}

void MpiExchange::sum(std::span<double> numbers) {
  if (size_ > 1) sumInSlices(numbers, MPI_DOUBLE, doubles_);
}

void MpiExchange::share(std::span<float> numbers) {
  if (size_ == 1) return;
  for (size_t first = 0; first < numbers.size(); first += kChunk) {
    const std::span<float> chunk = numbers.subspan(first, std::min(kChunk, numbers.size() - first));
    floats_.out.assign(chunk.begin(), chunk.end());
    MPI_Request request = MPI_REQUEST_NULL;
    check(MPI_Ibcast(floats_.out.data(), static_cast<int>(chunk.size()), MPI_FLOAT, 0, numbers_,
                     &request),
          "handing out weights");
    wait(request, "handing out weights");
    std::copy(floats_.out.begin(), floats_.out.end(), chunk.begin());
  }
}

void MpiExchange::meet() {
  MPI_Request request = MPI_REQUEST_NULL;
  check(MPI_Ibarrier(numbers_, &request), "waiting for the end");
  wait(request, "waiting for the end");
}

void MpiExchange::tellLeader(const std::string& why) {
  if (rank_ == 0 || telling_ != MPI_REQUEST_NULL) return;
  told_.assign(why.begin(),
               why.begin() + static_cast<ptrdiff_t>(std::min(why.size(), kLongestText - 1)));
  told_.push_back('\0');
  // Where this fails the leader hears of it by the end of the process.
  MPI_Isend(told_.data(), static_cast<int>(told_.size()), MPI_CHAR, 0, kWordTag, words_, &telling_);
}

void MpiExchange::linger(double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < end) {
    int is_done = 0;
    MPI_Test(&telling_, &is_done, MPI_STATUS_IGNORE);
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace stipple
