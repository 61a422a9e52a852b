//! Work is counted, not timed, so that a budget means the same on every machine.

/// Work done, and how much there may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Work {
    /// Units done; a unit is about one edge looked at.
    pub(crate) done: u64,
    /// Units allowed.
    pub(crate) limit: u64,
}

impl Work {
    /// Nothing done yet.
    pub(crate) fn up_to(limit: u64) -> Self {
        Self { done: 0, limit }
    }

    /// Counts units.
    pub(crate) fn spend(&mut self, units: usize) {
        self.done += units as u64;
    }

    /// Whether the limit is reached.
    pub(crate) fn is_spent(&self) -> bool {
        self.done >= self.limit
    }
}
