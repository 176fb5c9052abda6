"use strict";
// Many trials: in workers if there are any, else in the page between two pictures; and the estimate of T_sync from them.

/** @typedef {{values: Values, master: bigint, trial: number, point: number}} Task a trial of one of several points */
/** @typedef {{task: Task, result: Result}} Done */

/** Time for which trials keep the page busy at once, if there are no workers, ms. */
const BUSY_MS = 12;

/** Return a function that makes the swarm for some values, or returns the last one if it has the same values. */
/** @param {Modules} modules @param {any} facts @returns {(values: Values) => any} */
function swarmMaker(modules, facts) {
  /** @type {any} */
  let swarm = null;
  return (values) => {
    if (!swarm || swarm.values !== values) swarm = new (facts.swarms ? Robots : Agents)(modules, facts, values);
    return swarm;
  };
}

/** Serve a page from a worker. @param {any} scope the worker's global scope */
function serve(scope) {
  /** @type {(values: Values) => any} */
  let make;
  /** @type {Values[]} */
  let points;
  scope.onmessage = (/** @type {MessageEvent} */ { data }) => {
    if (data.modules) [make, points] = [swarmMaker(data.modules, data.facts), data.points];
    else scope.postMessage({ task: data, result: runTask(make(points[data.point]), data) });
  };
}

/** Run a trial to its end. @param {any} swarm @param {Task} task @returns {Result} */
function runTask(swarm, task) {
  swarm.reset(swarm.seeds.of(task.master, task.trial));
  const run = swarm.run();
  let step = run.next();
  while (!step.done) step = run.next();
  return step.value;
}

/** Runs trials, one set at a time, and reports each result. */
class Trials {
  /** @param {string} source of a worker @param {Modules} modules @param {any} facts */
  constructor(source, modules, facts) {
    this.modules = modules;
    this.facts = facts;
    this.address = typeof Blob === "undefined" ? "" : URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    this.workers = /** @type {Worker[]} */ ([]);
    this.round = 0;
  }

  /** Run `count` trials with the values of each point. */
  /** @param {Values[]} points @param {number} count @param {bigint} master @param {(done: Done) => void} tell @param {() => void} alone called if there are no workers */
  async run(points, count, master, tell, alone) {
    this.stop();
    const round = this.round;
    const tasks = points.flatMap((values, point) => Array.from({ length: count }, (_, trial) => ({ values, master, trial, point })));
    const left = await this.in_workers(points, tasks, tell, round);
    if (round !== this.round || !left.length) return;
    alone();
    await this.in_page(left, tell, round);
  }

  stop() {
    this.round += 1;
    for (const worker of this.workers) worker.terminate();
    this.workers = [];
    if (this.settle) this.settle();
  }

  /** Run trials in workers; return those that are left over, if workers fail. */
  /** @param {Values[]} points @param {Task[]} tasks @param {(done: Done) => void} tell @param {number} round @returns {Promise<Task[]>} */
  in_workers(points, tasks, tell, round) {
    const open = new Map(tasks.map((task, number) => [number, task]));
    const waiting = [...open.keys()], { modules, facts } = this;
    return new Promise((resolve) => {
      this.settle = () => resolve([...open.values()]);
      const give = (/** @type {Worker} */ worker) => {
        const number = waiting.shift();
        if (number !== undefined) worker.postMessage({ ...tasks[number], values: null, number });
      };
      const cores = Math.max(1, Math.min(8, (navigator.hardwareConcurrency || 2) - 1, tasks.length));
      try {
        for (let each = 0; each < cores; each++) {
          const worker = new Worker(this.address);
          this.workers.push(worker);
          worker.onerror = (error) => {
            error.preventDefault();
            if (round === this.round) resolve([...open.values()]);
          };
          worker.onmessage = ({ data }) => {
            if (round !== this.round || !open.delete(data.task.number)) return;
            tell({ task: tasks[data.task.number], result: data.result });
            give(worker);
            if (!open.size) resolve([]);
          };
          worker.postMessage({ modules, facts, points });
          give(worker);
        }
      } catch {
        resolve([...open.values()]);
      }
    });
  }

  /** Run trials in the page, a little at a time. @param {Task[]} tasks @param {(done: Done) => void} tell @param {number} round */
  async in_page(tasks, tell, round) {
    const make = swarmMaker(this.modules, this.facts);
    let until = performance.now() + BUSY_MS;
    for (const task of tasks) {
      const swarm = make(task.values);
      swarm.reset(swarm.seeds.of(task.master, task.trial));
      for (const run = swarm.run(); ; ) {
        const step = run.next();
        if (performance.now() > until) {
          await new Promise((resolve) => setTimeout(resolve));
          if (round !== this.round) return;
          until = performance.now() + BUSY_MS;
        }
        if (step.done) {
          tell({ task, result: step.value });
          break;
        }
      }
    }
  }
}

/** Fewest trials for an interval. */
const MIN_TRIALS = 5;

/** Return the mean of T_sync in cycles, restricted to a limit where trials are censored, with its 95 % interval. */
/** @param {Result[]} results @param {number} limit in cycles @param {number[]} student quantiles for 1 degree of freedom and more */
function estimate(results, limit, student) {
  const trials = results.length, observed = results.filter((each) => each.is_synchronised).length;
  if (!observed) return { mean: NaN, low: NaN, high: NaN };
  const all = observed === trials, horizon = Math.min(limit, Math.max(...results.map((each) => each.cycles)));
  const { mean, error } = all ? sampleMean(results) : restrictedMean(results, horizon);
  const freedom = Math.min(trials - 1, observed);
  if (trials < MIN_TRIALS || !error) return { mean, low: NaN, high: NaN };
  const reach = student[Math.min(freedom, student.length) - 1] * error, factor = Math.exp(reach / mean);
  return { mean, low: mean / factor, high: Math.min(mean * factor, all ? Infinity : horizon) };
}

/** @param {Result[]} results */
function sampleMean(results) {
  const times = results.map((each) => each.cycles), trials = times.length, mean = times.reduce((sum, each) => sum + each, 0) / trials;
  const square = times.reduce((sum, each) => sum + (each - mean) ** 2, 0);
  return { mean, error: trials > 1 ? Math.sqrt(square / (trials - 1) / trials) : 0 };
}

/** Return the area under the Kaplan-Meier curve up to a limit, and its standard error by Greenwood's formula. */
/** @param {Result[]} results @param {number} limit */
function restrictedMean(results, limit) {
  const times = [...new Set(results.filter((each) => each.is_synchronised).map((each) => each.cycles))].sort((one, other) => one - other);
  const steps = times.map((time) => {
    const risk = results.filter((each) => each.cycles >= time).length;
    return { time: Math.min(time, limit), risk, events: results.filter((each) => each.is_synchronised && each.cycles === time).length };
  });
  let survival = 1, from = 0;
  const areas = steps.map(({ time, risk, events }) => {
    const area = survival * (time - from);
    [from, survival] = [time, (survival * (risk - events)) / risk];
    return area;
  });
  areas.push(survival * (limit - from));
  let after = 0, variance = 0;
  for (let each = steps.length - 1; each >= 0; each--) {
    after += areas[each + 1];
    variance += (after ** 2 * steps[each].events) / (steps[each].risk * Math.max(steps[each].risk - steps[each].events, 1));
  }
  const trials = results.length;
  return { mean: areas.reduce((sum, each) => sum + each, 0), error: Math.sqrt((variance * trials) / Math.max(trials - 1, 1)) };
}
