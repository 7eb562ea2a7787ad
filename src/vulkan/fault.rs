//! Faults on demand, and the one place where results of Vulkan calls become errors.
//!
//! Tests of error paths cannot wait for a driver to run out of memory, so every fallible call of the wrappers
//! passes through `FaultInjection::call`, where a test can make the n-th call of the whole run, or of one name,
//! report any result. Without a fault set, the cost is one uncontended lock per call that reaches a driver.

use super::VulkanError;
use ash::{prelude::VkResult, vk};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Which calls fail. Clones share their state, so a test keeps one and gives the other to the context.
#[derive(Clone, Debug, Default)]
pub struct FaultInjection(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    /// All calls so far, in order; recorded only for tests that ask.
    calls: Vec<&'static str>,
    record: bool,
    faults: Vec<Fault>,
    omit_barriers: bool,
}

#[derive(Debug)]
struct Fault {
    /// Name of the call; any call if empty.
    call: &'static str,
    /// How many matching calls succeed before.
    skip: usize,
    result: vk::Result,
}

impl FaultInjection {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the call of this name (any call if empty) fail with `result`, after `skip` calls that work.
    pub fn fail(&self, call: &'static str, skip: usize, result: vk::Result) {
        self.state().faults.push(Fault { call, skip, result });
    }

    /// Forgets faults that have not happened.
    pub fn clear(&self) {
        self.state().faults.clear();
    }

    /// Starts to write down the names of calls.
    pub fn record(&self) {
        let mut state = self.state();
        state.record = true;
        state.calls.clear();
    }

    /// Names of the calls since [`Self::record`].
    pub fn calls(&self) -> Vec<&'static str> {
        self.state().calls.clone()
    }

    /// Leaves all barriers out: the negative control of synchronization validation.
    pub fn omit_barriers(&self, omit: bool) {
        self.state().omit_barriers = omit;
    }

    pub(super) fn omits_barriers(&self) -> bool {
        self.state().omit_barriers
    }

    /// The result that the next call of this name shall have instead of its own.
    pub(super) fn next(&self, call: &'static str) -> Option<vk::Result> {
        let mut state = self.state();
        if state.record {
            state.calls.push(call);
        }
        let mut due = None;
        state.faults.retain_mut(|fault| {
            if !fault.call.is_empty() && fault.call != call {
                return true;
            }
            if fault.skip > 0 {
                fault.skip -= 1;
                return true;
            }
            due.get_or_insert(fault.result);
            false
        });
        due
    }

    /// Makes a call, or the fault that is due instead of it.
    ///
    /// # Errors
    /// [`VulkanError::Call`] with the name, what it was for, and the result.
    pub(super) fn call<T>(
        &self,
        call: &'static str,
        what: &str,
        make: impl FnOnce() -> VkResult<T>,
    ) -> Result<T, VulkanError> {
        let result = match self.next(call) {
            Some(fault) => Err(fault),
            None => make(),
        };
        result.map_err(|result| VulkanError::Call { call, what: what.to_owned(), result })
    }
}
