//! Chunks side by side, each on its part of the threads.

use super::chunk::{Bench, Done, Job, Part, Spent};
use super::thread_pool;
use crate::error::Result;
use crate::report::state::Left;
use rayon::ThreadPool;
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;

/// A frame that is done with the number of its chunk, or why a chunk has ended.
pub(super) type Told = Result<(usize, Done)>;

/// Fits chunks side by side: the first with `bench`, the others with benches of their own, which add to what was `spent`. Meanwhile `take`
/// gets every frame that is done with the number of its chunk; where it ends with an error, so do the chunks.
///
/// # Errors
/// Those of `take`; no threads.
pub(super) fn side_by_side(
    bench: &mut Bench<'_>,
    (job, parts, lefts): (&Job<'_>, &[Part], Vec<Left>),
    spent: &mut Spent,
    take: impl FnOnce(Receiver<Told>) -> Result<()>,
) -> Result<()> {
    let threads = rayon::current_num_threads();
    let workers = parts.len().min(threads);
    let pools = (0..workers).map(|_| thread_pool(threads / workers)).collect::<Result<Vec<_>>>()?;
    let mut chunks = parts.iter().zip(lefts).enumerate();
    let mut first = chunks.next().map(|chunk| (bench, chunk));
    let others = Mutex::new(chunks);
    let (tell, told) = channel();
    thread::scope(|scope| {
        let worker = |pool: ThreadPool| {
            let (first, others, tell) = (first.take(), &others, tell.clone());
            scope.spawn(move || pool.install(|| labour(job, first, others, &tell)))
        };
        let workers: Vec<_> = pools.into_iter().map(worker).collect();
        drop(tell);
        let taken = take(told);
        for worker in workers {
            spent.add(&worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        }
        taken
    })
}

/// A chunk that has not begun: its number, what it is, and what an earlier process left of it.
type Todo<'p> = (usize, (&'p Part, Left));

/// Does the first chunk with a bench that there is, then others with benches of their own while there are any; gives back what those
/// have cost.
fn labour<'p>(
    job: &Job<'_>,
    first: Option<(&mut Bench<'_>, Todo<'p>)>,
    others: &Mutex<impl Iterator<Item = Todo<'p>>>,
    tell: &Sender<Told>,
) -> Spent {
    let mut spent = Spent::default();
    let chunk = |bench: &mut Bench<'_>, (k, (part, left)): Todo<'p>| {
        bench.work(job, part, left, &mut |done| tell.send(Ok((k, done))).is_ok())
    };
    let work = || -> Result<()> {
        if let Some((bench, todo)) = first
            && !chunk(bench, todo)?
        {
            return Ok(());
        }
        loop {
            // no thread panics with the lock in its hands
            let todo = others.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(todo) = todo else { return Ok(()) };
            let mut bench = Bench::new(job)?;
            let ended = chunk(&mut bench, todo);
            spent.add(&bench.cost());
            if !ended? {
                return Ok(());
            }
        }
    };
    if let Err(error) = work() {
        // nobody asks where the run has ended with an error already
        let _ = tell.send(Err(error));
    }
    spent
}
