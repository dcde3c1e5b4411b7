// The video with what is drawn over it: marks to be dragged, the track, the model's bodies.
// Scrubbing and dragging happen here; Python hears where a mark was let go, and nothing between.
const LOUPE = 4, LOUPE_PX = 150, KEEP = 400;

export default {
  template: `
  <div class="viewer" tabindex="0" ref="root" @keydown="key" :aria-label="'video ' + name">
    <div class="screen"><div class="stage" ref="stage" :style="{ '--ratio': width / height }">
      <img ref="img" class="frame" :src="url(shown)" draggable="false" alt="" @load="loaded" @error="loaded">
      <svg ref="svg" :data-follow="follow === null ? '' : follow" :viewBox="'0 0 ' + width + ' ' + height" @pointerdown="background"
           @pointermove="drag" @pointerup="drop" @pointercancel="drop" :class="{ placing: placing }">
        <g v-if="track">
          <g v-for="(places, i) in track.seen_px" :key="'t' + i" :class="'object' + (i % 3)">
            <path class="trail" :d="trail(places)"/>
            <g v-if="places[frame] && places[frame][0] !== null">
              <ellipse v-if="track.sd_px" class="error" :cx="places[frame][0]" :cy="places[frame][1]"
                :rx="Math.max(3 * track.sd_px[i][frame][0], 3 * k)"
                :ry="Math.max(3 * track.sd_px[i][frame][1], 3 * k)"/>
              <path class="cross" :d="cross(places[frame])"/>
            </g>
          </g>
        </g>
        <g v-if="track && !editable">
          <g v-for="([i, at, x, y], n) in told" :key="'c' + n" :class="'object' + (i % 3)">
            <rect v-if="at === frame" class="told" :x="x - 6 * k" :y="y - 6 * k" :width="12 * k" :height="12 * k"/>
          </g>
        </g>
        <g v-if="model && model.model_px">
          <g v-for="(outline, i) in model.outlines" :key="'m' + i" :class="'object' + (i % 3)">
            <polygon v-if="body(i)" class="body" :points="corners(outline)" :transform="body(i)"/>
          </g>
        </g>
        <g v-for="([x, y, w, h], n) in frame ? [] : things" :key="'s' + n" class="thing">
          <rect class="mark" :x="x - w / 2" :y="y - h / 2" :width="w" :height="h"/>
          <text class="label" :font-size="15 * k" :x="x - w / 2" :y="y - h / 2 - 4 * k">{{ n + 1 }}</text>
        </g>
        <g v-if="editable">
          <line v-if="at.upper && at.foot" class="ramp" v-bind="ends('upper', 'foot')"/>
          <line v-if="at.upper && at.foot && table" class="ramp table" :x1="at.foot[0]"
            :y1="at.foot[1]" :x2="at.upper[0] < at.foot[0] ? width : 0" :y2="at.foot[1]"/>
          <polygon v-if="at.corner1" class="stick side" :points="corners([at.corner1, at.corner2, at.corner3, at.corner4])"/>
          <text v-if="at.corner1" class="label" :font-size="13 * k" text-anchor="middle"
            :x="(at.corner1[0] + at.corner2[0]) / 2" :y="(at.corner1[1] + at.corner2[1]) / 2 - 8 * k">{{ sides[0] }}</text>
          <text v-if="at.corner1" class="label" :font-size="13 * k"
            :x="(at.corner2[0] + at.corner3[0]) / 2 + 8 * k" :y="(at.corner2[1] + at.corner3[1]) / 2">{{ sides[1] }}</text>
          <line v-if="at.stick1 && at.stick2" class="stick" v-bind="ends('stick1', 'stick2')"/>
          <text v-if="at.stick1 && at.stick2" class="label" :font-size="13 * k" text-anchor="middle"
            :x="(at.stick1[0] + at.stick2[0]) / 2" :y="(at.stick1[1] + at.stick2[1]) / 2 - 8 * k">
            {{ stick }}</text>
          <g v-for="(place, handle) in at" :key="handle" class="handle" :class="kind(handle)"
             :data-handle="handle" :transform="'translate(' + place[0] + ' ' + place[1] + ')'"
             tabindex="0" role="slider" :aria-label="words[handle] || handle"
             :aria-valuetext="Math.round(place[0]) + ', ' + Math.round(place[1])"
             @pointerdown.stop="grab($event, handle)" @keydown.stop="nudge($event, handle)">
            <rect v-if="boxes[handle]" class="box" :x="-boxes[handle][0] / 2"
              :y="-boxes[handle][1] / 2" :width="boxes[handle][0]" :height="boxes[handle][1]"
              :transform="'rotate(' + tilt(place) + ')'"/>
            <circle class="target" :r="22 * k"/>
            <circle class="ring" :r="7 * k"/><circle class="dot" :r="1.6 * k"/>
            <text class="label" :font-size="13 * k" :x="11 * k" :y="(kind(handle) === 'rampend' ? 20 : -9) * k">
              {{ kind(handle) === 'stickend' ? '' : words[handle] || handle }}</text>
          </g>
        </g>
      </svg>
      <canvas v-show="loupe" ref="loupe" class="loupe" width="300" height="300"
        :class="{ left: loupe && loupe[0] > width / 2 }"></canvas>
    </div></div>
    <div class="scrub">
      <button type="button" class="round" @click="play" :aria-label="timer ? 'Pause' : 'Play'">
        {{ timer ? '❚❚' : '▶' }}</button>
      <button type="button" class="round" @click="step(-1)" aria-label="One frame back">‹</button>
      <div class="slide"><i v-for="(one, n) in stretches" :key="n" :style="where(one)"></i>
      <b v-if="first > 0" :style="unused(0, first)"></b>
      <b v-if="last < count - 1" :style="unused(last, count - 1)"></b>
      <u v-for="(one, n) in told" :key="'u' + n" :style="{ left: share(one[1]) }"></u>
      <input type="range" min="0" :max="Math.max(count - 1, 0)" :value="frame" aria-label="Frame"
        @input="go(+$event.target.value)"></div>
      <button type="button" class="round" @click="step(1)" aria-label="One frame forward">›</button>
      <output>{{ (frame / fps).toFixed(3) }} s · {{ frame }}</output>
    </div>
  </div>`,
  props: {
    name: String, count: Number, fps: Number, width: Number, height: Number,
    marks: Object, words: Object, boxes: Object, stick: String, editable: Boolean, table: Boolean,
    placing: Boolean, track: Object, model: Object, stretches: Array, sides: Array,
    told: Array, things: Array, follow: Number, first: Number, last: Number,
  },
  data: () => ({ frame: 0, shown: 0, k: 1, at: {}, held: null, moved: false, loupe: null,
                 timer: null, cache: new Map() }),
  watch: {
    marks: { handler(now) { if (!this.held) this.at = { ...now }; }, immediate: true, deep: true },
    follow(now) { if (now !== null && now >= 0 && !this.timer) this.go(now); },
    name() { this.cache.clear(); this.waiting = false; this.go(0); this.fetchAhead(); },
  },
  mounted() {
    this.observer = new ResizeObserver(() => {
      const box = this.$refs.svg.clientWidth;
      if (box) this.k = this.width / box;
    });
    this.observer.observe(this.$refs.stage);
    this.onGo = (event) => this.go(Math.round(event.detail * this.fps));
    window.addEventListener("galileo-go", this.onGo);
    this.fetchAhead();
  },
  unmounted() {
    this.observer.disconnect();
    window.removeEventListener("galileo-go", this.onGo);
    clearInterval(this.timer);
  },
  methods: {
    url(frame) { return this.count ? `/frame/${encodeURIComponent(this.name)}/${frame}` : ""; },
    fetchAhead() {  // a few at a time, in order, so that scrubbing never waits
      const name = this.name;
      let next = 0;
      const more = () => {
        if (this.name !== name || next >= Math.min(this.count, KEEP)) return;
        const frame = next++;
        const image = new Image();
        image.onload = image.onerror = more;
        image.src = this.url(frame);
        this.cache.set(frame, image);
      };
      more(); more();
    },
    go(frame) {
      frame = Math.max(0, Math.min(frame, this.count - 1));
      if (!Number.isFinite(frame)) return;
      this.frame = frame;
      if (!this.waiting && frame !== this.shown) { this.waiting = true; this.shown = frame; }
      window.galileoTime = frame / this.fps;
      window.dispatchEvent(new CustomEvent("galileo-time", { detail: frame / this.fps }));
      clearTimeout(this.telling);
      this.telling = setTimeout(() => this.$emit("frame", frame), 120);
    },
    loaded() {
      this.waiting = false;
      if (this.shown !== this.frame) { this.waiting = true; this.shown = this.frame; }
      if (this.loupe) this.drawLoupe();
    },
    step(by) { this.go(this.frame + by); },
    play() {
      if (this.timer) { clearInterval(this.timer); this.timer = null; return; }
      const stride = Math.max(1, Math.round(this.fps / 60));
      this.timer = setInterval(() => {
        if (this.frame >= this.count - 1) this.go(0); else this.step(stride);
      }, 1000 * stride / Math.min(this.fps, 60) * (this.fps > 60 ? 2 : 1));
    },
    key(event) {
      const steps = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 };
      if (event.target.tagName === "INPUT" && event.key.startsWith("Arrow")) return;
      if (event.key in steps) this.step(steps[event.key] * (event.shiftKey ? 10 : 1));
      else if (event.key === " ") this.play();
      else if (event.key === "Home") this.go(0);
      else if (event.key === "End") this.go(this.count - 1);
      else return;
      event.preventDefault();
    },
    point(event) {
      const place = new DOMPoint(event.clientX, event.clientY)
        .matrixTransform(this.$refs.svg.getScreenCTM().inverse());
      return [Math.max(0, Math.min(place.x, this.width)), Math.max(0, Math.min(place.y, this.height))];
    },
    background(event) {
      this.$refs.root.focus();
      if (this.placing) this.$emit("place", [...this.point(event).map((v) => +v.toFixed(2)), this.frame]);
    },
    grab(event, handle) {
      const [x, y] = this.point(event);
      this.held = { handle, dx: this.at[handle][0] - x, dy: this.at[handle][1] - y };
      this.moved = false;
      this.$refs.svg.setPointerCapture(event.pointerId);
      event.currentTarget.focus();
      this.loupe = this.at[handle];
      this.drawLoupe();
    },
    drag(event) {
      if (!this.held) return;
      const [x, y] = this.point(event);
      const { handle, dx, dy } = this.held;
      const to = [x + dx, y + dy];
      if (handle === "foot" && this.table && this.at.upper) {
        const foot = this.at.foot;
        this.at.upper = this.at.upper.map((v, i) => v + to[i] - foot[i]);
      }
      this.at[handle] = to;
      this.moved = true;
      this.loupe = to;
      this.drawLoupe();
    },
    drop() {
      if (!this.held) return;
      const { handle } = this.held;
      this.held = null;
      this.loupe = null;
      if (this.moved) this.tell(handle);
    },
    nudge(event, handle) {  // the keyboard: a tenth of a pixel with Alt, ten with Shift
      const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
      if (!(event.key in ways)) { this.key(event); return; }
      const size = event.shiftKey ? 10 : event.altKey ? 0.1 : 1;
      this.at[handle] = this.at[handle].map((v, i) => v + size * ways[event.key][i]);
      clearTimeout(this.nudging);
      this.nudging = setTimeout(() => this.tell(handle), 300);
      event.preventDefault();
    },
    tell(handle) {
      this.$emit("moved", { handle, x: +this.at[handle][0].toFixed(2), y: +this.at[handle][1].toFixed(2) });
    },
    drawLoupe() {
      this.$nextTick(() => {
        const canvas = this.$refs.loupe, img = this.$refs.img;
        if (!canvas || !img.naturalWidth || !this.loupe) return;
        const pen = canvas.getContext("2d"), scale = img.naturalWidth / this.width;
        const side = LOUPE_PX * this.k / LOUPE * scale;
        pen.imageSmoothingEnabled = false;
        pen.fillStyle = "#000"; pen.fillRect(0, 0, 300, 300);
        pen.drawImage(img, this.loupe[0] * scale - side / 2, this.loupe[1] * scale - side / 2,
                      side, side, 0, 0, 300, 300);
        for (const [colour, width] of [["rgba(0,0,0,0.6)", 4], ["#fff", 1.5]]) {
          pen.strokeStyle = colour; pen.lineWidth = width;
          pen.beginPath(); pen.moveTo(150, 100); pen.lineTo(150, 200);
          pen.moveTo(100, 150); pen.lineTo(200, 150); pen.stroke();
        }
      });
    },
    trail(places) {
      let path = "", down = false;
      for (const [x, y] of places) {
        if (x === null) { down = false; continue; }
        path += `${down ? "L" : "M"}${x} ${y}`;
        down = true;
      }
      return path;
    },
    cross([x, y]) {
      const a = 9 * this.k;
      return `M${x - a} ${y}H${x + a}M${x} ${y - a}V${y + a}`;
    },
    ends(one, other) {
      const [[x1, y1], [x2, y2]] = [this.at[one], this.at[other]];
      return { x1, y1, x2, y2 };
    },
    tilt([x]) {  // a box on the ramp stands along it
      const { upper, foot } = this.at;
      if (!upper || !foot || (this.table && (x - foot[0]) * (foot[0] - upper[0]) > 0)) return 0;
      return Math.atan((foot[1] - upper[1]) / (foot[0] - upper[0])) * 180 / Math.PI;
    },
    kind(handle) {
      if (handle.startsWith("stick")) return "stickend";
      if (handle.startsWith("corner")) return "corner";
      return handle === "upper" || handle === "foot" ? "rampend" : "thing";
    },
    body(i) {
      const place = this.model.model_px[i][this.frame];
      if (!place || place[0] === null) return null;
      return `translate(${place[0]} ${place[1]}) rotate(${this.model.turned[i][this.frame]})`;
    },
    corners(outline) { return outline.map((corner) => corner.join(",")).join(" "); },
    share(frame) { return `${100 * frame / Math.max(this.count - 1, 1)}%`; },
    unused(from, to) { return { left: this.share(from), width: this.share(to - from) }; },
    where(one) {
      const end = Math.max(this.count - 1, 1) / this.fps;
      return { left: `${100 * one.start / end}%`, width: `${100 * (one.end - one.start) / end}%` };
    },
  },
};
