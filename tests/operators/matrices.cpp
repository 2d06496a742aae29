#include "operators/matrices.hpp"

#include <Eigen/Dense>

namespace debias::testing {

double trace_by_eigenvalues(const Eigen::MatrixXd& a, const std::function<double(double)>& f) {
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues();
  double sum = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) sum += f(values[i]);
  return sum;
}

Eigen::MatrixXd function_by_eigenvalues(const Eigen::MatrixXd& a, const std::function<double(double)>& f) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(a);
  Eigen::VectorXd values = solver.eigenvalues();
  for (Eigen::Index i = 0; i < values.size(); ++i) values[i] = f(values[i]);
  return solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
}

double largest_eigenvalue(const Eigen::MatrixXd& a) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues().maxCoeff();
}

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& a) { return a.inverse(); }

Eigen::VectorXd solved(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) { return a.ldlt().solve(b); }

}  // namespace debias::testing
