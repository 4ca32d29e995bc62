//! argmin beside us: what its iterations did, and its errors.

use super::estimate::FitIteration;
use super::gauss_newton::GaussNewtonState;
use crate::error::Error;
use argmin::core::KV;
use argmin::core::observers::Observe;
use std::sync::{Arc, Mutex, PoisonError};

/// argmin wraps errors; ours come out again as they went in.
pub(super) fn own_error(error: argmin::core::Error) -> Error {
    error.downcast::<Error>().unwrap_or_else(|other| Error::Optimiser { message: other.to_string() })
}

/// An argmin observer that keeps what each iteration did.
#[derive(Clone, Default)]
pub(super) struct Log(Arc<Mutex<Vec<FitIteration>>>);

impl Log {
    pub(super) fn take(&self) -> Vec<FitIteration> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Observe<GaussNewtonState> for Log {
    fn observe_iter(&mut self, state: &GaussNewtonState, kv: &KV) -> std::result::Result<(), argmin::core::Error> {
        let number = |key: &str| kv.get(key).and_then(|v| v.get_float()).unwrap_or(f64::NAN);
        let rejected = kv.get("rejected").and_then(|v| v.get_uint()).unwrap_or(0);
        let iteration = FitIteration {
            cost: state.get_cost(),
            step: number("step"),
            left: number("left"),
            trust: number("trust"),
            rejected,
        };
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(iteration);
        Ok(())
    }
}
