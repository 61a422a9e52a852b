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

    /// A part of the budget, as a share of the whole, but no more than what is left.
    pub(crate) fn slice(&self, share: f64) -> Self {
        Self::up_to(((self.limit as f64 * share) as u64).min(self.limit.saturating_sub(self.done)))
    }

    /// Counts what a slice has spent.
    pub(crate) fn add(&mut self, slice: Self) {
        self.done += slice.done;
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
