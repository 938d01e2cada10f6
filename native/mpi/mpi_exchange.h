#pragma once

#include <mpi.h>

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/progress.h"
#include "train/networks/gradient_exchange.h"

namespace stipple {

/// Exchanges by MPI, over all processes that were started together. Every wait is polled: it ends
/// when this process is cancelled, and that of rank 0 also when another tells that it cannot go on.
/// After an error no further exchange is possible, and the memory of those that were begun belongs
/// to MPI: the process ends with this object alive, by MPI_Abort. One thread uses it.
class MpiExchange final : public GradientExchange {
 public:
  /// In: progress of this process's work, which outlives this. Errors: kUnavailable.
  explicit MpiExchange(const Progress& progress);

  size_t rank() const override { return rank_; }
  size_t size() const override { return size_; }
  /// Cost: each rank sums a slice and gives it to all, so that it sends and receives twice as many
  /// numbers as there are, whatever the ranks. Memory: some MiB.
  void sum(std::span<float> numbers) override;
  void sum(std::span<double> numbers) override;
  void share(std::span<float> numbers) override;

  /// Returns when all have called it. Errors: as sum().
  void meet();
  /// Tells rank 0 why this process cannot go on: its next wait ends with kUnavailable and that
  /// text. Returns at once; linger() delivers it.
  void tellLeader(const std::string& why);
  /// Lets MPI work until `seconds` have passed.
  void linger(double seconds);

 private:
  template <class T>
  struct Buffers {
    std::vector<T> out, in, slice;
  };

  template <class T>
  void sumInSlices(std::span<T> numbers, MPI_Datatype type, Buffers<T>& buffers);
  void check(int code, const char* doing) const;
  void wait(MPI_Request request, const char* doing);
  void listen();

  const Progress& progress_;
  size_t rank_ = 0, size_ = 1;
  MPI_Comm numbers_ = MPI_COMM_NULL, words_ = MPI_COMM_NULL;
  Buffers<float> floats_;
  Buffers<double> doubles_;
  std::vector<char> heard_, told_;
  MPI_Request hearing_ = MPI_REQUEST_NULL, telling_ = MPI_REQUEST_NULL;
};

}  // namespace stipple
