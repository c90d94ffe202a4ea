// Torque of a chain of revolute joints and its two exact rates by Pinocchio in C++: the first rate from the first
// derivatives of inverse dynamics, the second from their tensors of second order. Built and called by arm.py.

// What Pinocchio's own build files define, without which Boost's lists are too short for its joints.
#define BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS
#define BOOST_MPL_LIMIT_LIST_SIZE 30
#define BOOST_MPL_LIMIT_VECTOR_SIZE 30
#define BOOST_FUSION_INVOKE_MAX_ARITY 12

#include <pinocchio/multibody.hpp>

#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea-second-order-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <memory>
#include <string>

namespace {

using Vector = Eigen::VectorXd;
using Columns = Eigen::Map<const Eigen::MatrixXd>;
using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Tensor = pinocchio::Data::Tensor3x;

struct Arm {
    pinocchio::Model model;
    std::unique_ptr<pinocchio::Data> data;
    Tensor by_qq, by_vv, by_qv, by_aq;
};

Arm arm;

// Add sum_bc T(:, b, c) x_b y_c times a factor to a vector; the first index of a tensor is contiguous.
void contract(const Tensor& tensor, const Vector& x, const Vector& y, double factor, Vector& sum) {
    const Eigen::Index n = x.size();
    for (Eigen::Index c = 0; c < n; ++c)
        for (Eigen::Index b = 0; b < n; ++b)
            sum.noalias() += (factor * x[b] * y[c]) * Eigen::Map<const Vector>(tensor.data() + (c * n + b) * n, n);
}

}  // namespace

#define EXPORTED extern "C" __attribute__((visibility("default")))

// Each joint is 25 numbers: placement (rotation by rows, position), mass, center of mass, inertia about it by rows.
EXPORTED void build(long joints, const double* numbers, const double* gravity) {
    arm.model = pinocchio::Model();
    arm.model.gravity.linear() = Eigen::Map<const Eigen::Vector3d>(gravity);
    pinocchio::JointIndex last = 0;
    for (long k = 0; k < joints; ++k, numbers += 25) {
        const pinocchio::SE3 place(Eigen::Map<const RowMajor>(numbers), Eigen::Map<const Eigen::Vector3d>(numbers + 9));
        const Eigen::Matrix3d inertia = Eigen::Map<const RowMajor>(numbers + 16);
        const pinocchio::Inertia body(numbers[12], Eigen::Map<const Eigen::Vector3d>(numbers + 13), inertia);
        last = arm.model.addJoint(last, pinocchio::JointModelRZ(), place, "joint_" + std::to_string(k));
        arm.model.appendBodyToJoint(last, body, pinocchio::SE3::Identity());
    }
    arm.data = std::make_unique<pinocchio::Data>(arm.model);
    for (Tensor* tensor : {&arm.by_qq, &arm.by_vv, &arm.by_qv, &arm.by_aq}) {
        *tensor = Tensor(joints, joints, joints);
        tensor->setZero();
    }
}

// From q and four derivatives of each sample write torque and as many rates as are asked for, up to two.
EXPORTED void torques(long samples, int rates, const double* motion, double* torque) {
    const Eigen::Index n = arm.model.nv;
    Vector q(n), v(n), a(n), j(n), s(n), first(n), second(n);
    pinocchio::Data& data = *arm.data;
    for (long k = 0; k < samples; ++k, motion += 5 * n, torque += (rates + 1) * n) {
        const Columns state(motion, n, 5);
        q = state.col(0), v = state.col(1), a = state.col(2), j = state.col(3), s = state.col(4);
        Eigen::Map<Eigen::MatrixXd> result(torque, n, rates + 1);
        if (rates == 0) {
            result.col(0) = pinocchio::rnea(arm.model, data, q, v, a);
            continue;
        }
        pinocchio::computeRNEADerivatives(arm.model, data, q, v, a);
        const auto mass = data.M.selfadjointView<Eigen::Upper>();
        result.col(0) = data.tau;
        first.noalias() = data.dtau_dq * v + data.dtau_dv * a + mass * j;
        result.col(1) = first;
        if (rates == 1) continue;
        second.noalias() = data.dtau_dq * a + data.dtau_dv * j + mass * s;
        pinocchio::ComputeRNEASecondOrderDerivatives(
            arm.model, data, q, v, a, arm.by_qq, arm.by_vv, arm.by_qv, arm.by_aq);
        contract(arm.by_qq, v, v, 1, second);
        contract(arm.by_vv, a, a, 1, second);
        contract(arm.by_qv, v, a, 2, second);
        contract(arm.by_aq, j, v, 2, second);
        result.col(2) = second;
    }
}
