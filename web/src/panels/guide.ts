import type { PanelFactory } from "../panel";

export const guide: PanelFactory = () => ({ element: document.createElement("div") });
